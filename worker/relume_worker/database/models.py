"""Tables of the ledger; `revisions` next to this file upgrades older ones."""

from __future__ import annotations

from typing import Any, ClassVar

from sqlalchemy import BigInteger, ForeignKey, Index, Integer, Text
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column


class Base(DeclarativeBase):
    """Base class of all tables in relume's database."""

    type_annotation_map: ClassVar[dict[Any, Any]] = {
        int: BigInteger().with_variant(Integer(), "sqlite")
    }  # bytes and rays exceed 32 bits


class SceneRow(Base):
    """A registered scene; its files are in scenes/<id>/.

    Attributes:
        summary: JSON for lists: views, materials, warnings, number of triangles.
    """

    __tablename__ = "scenes"

    id: Mapped[str] = mapped_column(primary_key=True)
    name: Mapped[str]
    created: Mapped[float]
    summary: Mapped[str] = mapped_column(Text)


class CameraRow(Base):
    """A placed camera of a scene; `document` is its JSON, see `relume.scene.custom_camera`."""

    __tablename__ = "cameras"

    scene_id: Mapped[str] = mapped_column(ForeignKey("scenes.id"), primary_key=True)
    name: Mapped[str] = mapped_column(primary_key=True)
    document: Mapped[str] = mapped_column(Text)


class JobRow(Base):
    """A bake, render, comparison or BTF job, see `relume_worker.jobs`. The service that runs it has the lease: `owner`,
    renewed by `heartbeat` (seconds since 1970 by the database's clock).

    Attributes:
        kind: name of its `Kind`. request: the body of the call as JSON; of a bake, its recipe.
        done: finished steps.
        client: who submitted it first; None in rows of older versions. is_first: somebody waits for it: it is small.
        priority: higher ones are first among the jobs of a client.
        created, queued, started, ended: seconds since 1970; None: not yet, or in a row of an older version.
            queued: last time, if it was queued again.
        scene_id, plan, progress, phase, phase_since, rays_per_second, seconds_left, bytes: of bakes, see
            `relume_worker.status`.
        code: code version that makes or made a bake. run: run marker of its unfinished store, see
            `relume_worker.run_marker`. crowding: when it was ready, see `relume_worker.estimate`. None in rows of
            older versions.
    """

    __tablename__ = "jobs"

    id: Mapped[str] = mapped_column(primary_key=True)
    kind: Mapped[str] = mapped_column(index=True)
    request: Mapped[str] = mapped_column(Text)
    state: Mapped[str] = mapped_column(index=True)
    done: Mapped[int] = mapped_column(default=0)
    problem: Mapped[str | None] = mapped_column(Text, default=None)
    created: Mapped[float]
    client: Mapped[str | None] = mapped_column(default=None)
    is_first: Mapped[bool | None] = mapped_column(default=None)
    priority: Mapped[int] = mapped_column(default=0, server_default="0")
    owner: Mapped[str | None] = mapped_column(default=None)
    heartbeat: Mapped[float | None] = mapped_column(default=None)
    started: Mapped[float | None] = mapped_column(default=None)
    ended: Mapped[float | None] = mapped_column(default=None)
    queued: Mapped[float | None] = mapped_column(default=None)
    scene_id: Mapped[str | None] = mapped_column(ForeignKey("scenes.id"), index=True, default=None)
    plan: Mapped[str | None] = mapped_column(Text, default=None)
    progress: Mapped[float | None] = mapped_column(default=None)
    phase: Mapped[str | None] = mapped_column(default=None)
    phase_since: Mapped[float | None] = mapped_column(default=None)
    rays_per_second: Mapped[float | None] = mapped_column(default=None)
    seconds_left: Mapped[float | None] = mapped_column(default=None)
    bytes: Mapped[int | None] = mapped_column(default=None)
    code: Mapped[str | None] = mapped_column(default=None)
    run: Mapped[str | None] = mapped_column(default=None)
    crowding: Mapped[float | None] = mapped_column(default=None)


class TaskRow(Base):
    """A finished task of a bake. The row is the only proof that its shards are on disk."""

    __tablename__ = "tasks"
    __table_args__ = (Index("tasks_of_bake", "bake_id"),)

    bake_id: Mapped[str] = mapped_column(ForeignKey("jobs.id"), primary_key=True)
    stage: Mapped[int] = mapped_column(primary_key=True)
    index: Mapped[int] = mapped_column("task_index", primary_key=True)
    attempts: Mapped[int]
    rays: Mapped[int]
    trace_s: Mapped[float]
    seconds: Mapped[float]
