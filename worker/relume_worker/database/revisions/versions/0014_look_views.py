"""Views of looks."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"
is_additive = True


def upgrade() -> None:
    """Upgrade from the previous revision."""
    op.add_column("looks", sa.Column("view", sa.Text(), nullable=True))
