"""Priorities of jobs."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"
is_additive = True


def upgrade() -> None:
    """Upgrade from the previous revision."""
    kind = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
    op.add_column("jobs", sa.Column("priority", kind, nullable=False, server_default="0"))
