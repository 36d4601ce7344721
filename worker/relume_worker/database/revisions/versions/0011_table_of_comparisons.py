"""The table of comparisons by its new name."""

from __future__ import annotations

from alembic import op

revision = "0011"
down_revision = "0010"
is_additive = True  # no release has used the former name


def upgrade() -> None:
    """Upgrade from the previous revision."""
    op.rename_table("truths", "comparisons")
    op.drop_index("ix_truths_state", "comparisons")
    op.create_index("ix_comparisons_state", "comparisons", ["state"])
