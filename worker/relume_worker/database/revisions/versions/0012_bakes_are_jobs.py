"""Bakes in the table of jobs."""

from __future__ import annotations

import json
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
is_additive = True  # no release has the former table

_NUMBERS = ("queued", "phase_since", "seconds_left", "progress", "rays_per_second", "crowding")
_COLUMNS: dict[str, sa.types.TypeEngine[Any]] = {
    **dict.fromkeys(_NUMBERS, sa.Double()),
    **dict.fromkeys(("scene_id", "phase", "code", "run"), sa.String()),
    "plan": sa.Text(),
    "bytes": sa.BigInteger().with_variant(sa.Integer(), "sqlite"),
}
_KEPT = ("id", "state", "problem", "created", "client", "owner", "heartbeat", *_COLUMNS)


def upgrade() -> None:
    """Upgrade from the previous revision; waiting and running bakes keep their places, leases and tasks."""
    with op.batch_alter_table("jobs") as jobs:
        for name, kind in _COLUMNS.items():
            jobs.add_column(sa.Column(name, kind, nullable=True))
        jobs.create_foreign_key("jobs_scene_id_fkey", "scenes", ["scene_id"], ["id"])
    op.create_index("ix_jobs_scene_id", "jobs", ["scene_id"])
    kept = ", ".join(f'"{name}"' for name in _KEPT)
    op.execute(f"INSERT INTO jobs (kind, request, done, {kept}) SELECT 'bake', recipe, 0, {kept} FROM bakes")  # noqa: S608
    connection = op.get_bind()
    small = sa.text("UPDATE jobs SET is_first = :is_first WHERE id = :id")
    for identity, plan in connection.execute(sa.text('SELECT id, "plan" FROM bakes')).all():
        connection.execute(small, {"id": identity, "is_first": _is_small(plan)})
    convention = {"fk": "%(table_name)s_%(column_0_name)s_fkey"}
    with op.batch_alter_table("tasks", naming_convention=convention) as tasks:
        tasks.drop_constraint("tasks_bake_id_fkey", type_="foreignkey")
        tasks.create_foreign_key("tasks_bake_id_fkey", "jobs", ["bake_id"], ["id"])
    op.drop_table("bakes")


def _is_small(plan: str) -> bool:
    try:
        cost = json.loads(plan)
        is_short = 0 < cost.get("work_s", 0.0) <= 20.0
        return bool(is_short or (cost["num_rays"] <= 400_000_000 and cost["store_bytes"] <= 512 << 20))
    except (ValueError, LookupError, TypeError, AttributeError):  # damaged
        return False
