"""Who has asked for a bake: clients have their turns."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
is_additive = True


def upgrade() -> None:
    """From the revision before."""
    op.add_column("bakes", sa.Column("client", sa.String(), nullable=True))
