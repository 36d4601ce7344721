"""Which server has a room: several servers may share the ledger."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
is_additive = True


def upgrade() -> None:
    """From the revision before."""
    op.create_table(
        "rooms",
        sa.Column("watch", sa.String(), nullable=False),
        sa.Column("owner", sa.String(), nullable=False),
        sa.Column("heartbeat", sa.Double(), nullable=False),
        sa.PrimaryKeyConstraint("watch"),
    )
