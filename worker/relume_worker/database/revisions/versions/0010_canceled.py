"""The state of a canceled bake in American spelling."""

from __future__ import annotations

from alembic import op

revision = "0010"
down_revision = "0009"
is_additive = True  # no release has written the other spelling


def upgrade() -> None:
    """Upgrade from the previous revision."""
    op.execute("UPDATE bakes SET state = 'canceled' WHERE state = 'cancelled'")
