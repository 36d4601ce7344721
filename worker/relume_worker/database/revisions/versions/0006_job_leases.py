"""Leases of renders, comparisons and BTF jobs, which several servers may share."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
is_additive = True


def upgrade() -> None:
    """Upgrade from the previous revision."""
    for table in ("renders", "truths", "btfs"):
        op.add_column(table, sa.Column("owner", sa.String(), nullable=True))
        op.add_column(table, sa.Column("heartbeat", sa.Double(), nullable=True))
