"""The state of canceled bakes, and the kind of BTF jobs that users own, by their new names."""

from __future__ import annotations

from alembic import op

revision = "0010"
down_revision = "0009"
is_additive = True  # no release has written the former values


def upgrade() -> None:
    """Upgrade from the previous revision."""
    op.execute("UPDATE bakes SET state = 'canceled' WHERE state = 'cancelled'")
    op.execute("UPDATE owned SET kind = 'btf-job' WHERE kind = 'btf-work'")
