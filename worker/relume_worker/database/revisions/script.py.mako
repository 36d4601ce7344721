"""${message}."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = ${repr(up_revision)}
down_revision = ${repr(down_revision)}
is_additive = True  # False where a relume from before it cannot work on: then people run `relume db upgrade`


def upgrade() -> None:
    """Upgrade from the previous revision."""
    ${upgrades if upgrades else "pass"}
