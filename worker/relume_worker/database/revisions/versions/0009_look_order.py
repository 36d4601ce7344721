"""Creation times and thumbnails of looks."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
is_additive = True


def upgrade() -> None:
    """Upgrade from the previous revision."""
    op.add_column("looks", sa.Column("created", sa.Double(), nullable=True))
    op.add_column("looks", sa.Column("thumbnail", sa.LargeBinary(), nullable=True))
    op.add_column("looks", sa.Column("thumbnail_of", sa.String(), nullable=True))
