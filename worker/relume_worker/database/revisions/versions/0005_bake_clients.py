"""Clients of bakes, for fair scheduling."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
is_additive = True


def upgrade() -> None:
    """Upgrade from the previous revision."""
    op.add_column("bakes", sa.Column("client", sa.String(), nullable=True))
