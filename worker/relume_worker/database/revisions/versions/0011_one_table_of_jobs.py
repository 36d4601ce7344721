"""Renders, comparisons and BTF jobs in one table."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
is_additive = True  # no release has the former tables

_COLUMNS = "id, request, state, done, problem, created, client, is_first, owner, heartbeat, started, ended"


def upgrade() -> None:
    """Upgrade from the previous revision."""
    op.create_table(
        "jobs",
        sa.Column("id", sa.String(), primary_key=True),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("request", sa.Text(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("done", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("problem", sa.Text(), nullable=True),
        sa.Column("created", sa.Double(), nullable=False),
        sa.Column("client", sa.String(), nullable=True),
        sa.Column("is_first", sa.Boolean(), nullable=True),
        sa.Column("owner", sa.String(), nullable=True),
        sa.Column("heartbeat", sa.Double(), nullable=True),
        sa.Column("started", sa.Double(), nullable=True),
        sa.Column("ended", sa.Double(), nullable=True),
    )
    for kind, table in (("render", "renders"), ("comparison", "truths"), ("btf", "btfs")):
        op.execute(f"INSERT INTO jobs (kind, {_COLUMNS}) SELECT '{kind}', {_COLUMNS} FROM {table}")  # noqa: S608
        op.drop_table(table)
    op.create_index("ix_jobs_kind", "jobs", ["kind"])
    op.create_index("ix_jobs_state", "jobs", ["state"])
