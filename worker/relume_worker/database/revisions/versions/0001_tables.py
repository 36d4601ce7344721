"""The tables before revisions were introduced.

A new database gets all of them; an older one gets what it lacks: tables of the server if only the command line was
used, and columns that later versions had added, all empty.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
is_additive = True

_INTEGER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
_METADATA = sa.MetaData()


def _table(name: str, *columns: sa.Column[object] | sa.Index) -> None:
    sa.Table(name, _METADATA, *columns)


def _needed(name: str, kind: object, *others: sa.ForeignKey, **options: bool) -> sa.Column[object]:
    return sa.Column(name, kind, *others, nullable=False, **options)  # type: ignore[arg-type]


_table(
    "scenes",
    _needed("id", sa.String(), primary_key=True),
    _needed("name", sa.String()),
    _needed("created", sa.Double()),
    _needed("summary", sa.Text()),
)
_table(
    "cameras",
    _needed("scene_id", sa.String(), sa.ForeignKey("scenes.id"), primary_key=True),
    _needed("name", sa.String(), primary_key=True),
    _needed("document", sa.Text()),
)
_table(
    "bakes",
    _needed("id", sa.String(), primary_key=True),
    _needed("scene_id", sa.String(), sa.ForeignKey("scenes.id"), index=True),
    _needed("recipe", sa.Text()),
    _needed("plan", sa.Text()),
    _needed("state", sa.String(), index=True),
    _needed("created", sa.Double()),
    _needed("queued", sa.Double()),
    _needed("progress", sa.Double()),
    sa.Column("phase", sa.String()),
    sa.Column("phase_since", sa.Double()),
    sa.Column("crowding", sa.Double()),
    sa.Column("code", sa.String()),
    sa.Column("rays_per_second", sa.Double()),
    sa.Column("seconds_left", sa.Double()),
    _needed("bytes", _INTEGER),
    sa.Column("problem", sa.Text()),
    sa.Column("owner", sa.String()),
    _needed("heartbeat", sa.Double()),
)
_table(
    "tasks",
    _needed("bake_id", sa.String(), sa.ForeignKey("bakes.id"), primary_key=True),
    _needed("stage", _INTEGER, primary_key=True),
    _needed("task_index", _INTEGER, primary_key=True),
    _needed("attempts", _INTEGER),
    _needed("rays", _INTEGER),
    _needed("trace_s", sa.Double()),
    _needed("seconds", sa.Double()),
    sa.Index("tasks_of_bake", "bake_id"),
)
_table(
    "looks",
    _needed("name", sa.String(), primary_key=True),
    _needed("document", sa.Text()),
    _needed("etag", sa.String()),
    _needed("modified", sa.Double()),
)
_table(
    "shares",
    _needed("id", sa.String(), primary_key=True),
    _needed("document", sa.Text()),
    _needed("bytes", _INTEGER),
    _needed("created", sa.Double()),
)
for _name in ("renders", "btfs", "truths"):
    _table(
        _name,
        _needed("id", sa.String(), primary_key=True),
        _needed("request", sa.Text()),
        _needed("state", sa.String(), index=True),
        _needed("done", _INTEGER),
        sa.Column("problem", sa.Text()),
        _needed("created", sa.Double()),
        sa.Column("client", sa.String()),
        sa.Column("is_first", sa.Boolean()),
    )


def upgrade() -> None:
    """Create the tables, or complete an older database."""
    connection = op.get_bind()
    _METADATA.create_all(connection)
    found = sa.inspect(connection)
    for table in _METADATA.sorted_tables:
        known = {column["name"] for column in found.get_columns(table.name)}
        for column in table.columns:
            if column.name not in known:
                op.add_column(table.name, sa.Column(column.name, column.type, nullable=column.nullable))
