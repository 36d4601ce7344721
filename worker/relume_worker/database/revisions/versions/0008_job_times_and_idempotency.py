"""Start and end times of jobs, and responses to calls with idempotency keys."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
is_additive = True


def upgrade() -> None:
    """Upgrade from the previous revision."""
    for table in ("renders", "truths", "btfs"):
        op.add_column(table, sa.Column("started", sa.Double(), nullable=True))
        op.add_column(table, sa.Column("ended", sa.Double(), nullable=True))
    op.create_table(
        "idempotency",
        sa.Column("client", sa.String(), nullable=False),
        sa.Column("key", sa.String(), nullable=False),
        sa.Column("digest", sa.String(), nullable=False),
        sa.Column("owner", sa.String(), nullable=False),
        sa.Column("created", sa.Double(), nullable=False),
        sa.Column("status", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=True),
        sa.Column("location", sa.Text(), nullable=True),
        sa.Column("media_type", sa.String(), nullable=True),
        sa.Column("body", sa.LargeBinary(), nullable=True),
        sa.PrimaryKeyConstraint("client", "key"),
    )
    op.create_index("ix_idempotency_created", "idempotency", ["created"])
