"""Leases of rooms, for several servers on one ledger."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
is_additive = True


def upgrade() -> None:
    """Upgrade from the previous revision."""
    op.create_table(
        "rooms",
        sa.Column("watch", sa.String(), nullable=False),
        sa.Column("owner", sa.String(), nullable=False),
        sa.Column("heartbeat", sa.Double(), nullable=False),
        sa.PrimaryKeyConstraint("watch"),
    )
