"""Run markers of bakes, which tell a machine whether finished tasks are in its own folder."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
is_additive = True


def upgrade() -> None:
    """Upgrade from the previous revision."""
    op.add_column("bakes", sa.Column("run", sa.String(), nullable=True))
