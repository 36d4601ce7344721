"""The ledger: all bakes with their progress and finished tasks, and all other jobs (`relume_worker.jobs.job_ledger`).

It is authoritative; the scheduler is disposable.
"""

from __future__ import annotations

import json
import time
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from functools import lru_cache
from sys import maxsize
from typing import Any, cast

from sqlalchemy import Engine, delete, func, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import sessionmaker

from relume.core.errors import NotFoundError, RelumeError
from relume.core.source_hash import bake_code
from relume.store.bake_protocol import Plan, Recipe, Task
from relume_worker.database.models import JobRow, TaskRow
from relume_worker.estimate import CompletedBake
from relume_worker.executor import is_tiny
from relume_worker.job_state import ACTIVE_STATES, JobState
from relume_worker.jobs.fair_share import FairShare, Waiting
from relume_worker.jobs.job import BAKE, UNREADABLE, Quota
from relume_worker.jobs.job_ledger import JobLedger, queue_again
from relume_worker.lease import new_owner
from relume_worker.status import BakeStatus, Phase, TaskCost, bake_id, recipe_from_json, recipe_json

_NO_QUOTA = Quota(maxsize, maxsize)
_UNKNOWN_RECIPE, _UNKNOWN_PLAN = Recipe("unknown", (), (1, 1), 1), Plan(0, 0, 0, 0)
"""Of a bake whose row cannot be read."""


class Ledger(JobLedger):
    """Bakes, their tasks and all other jobs in a database. Safe for several threads and processes."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        super().__init__(sessionmaker(engine, expire_on_commit=False), _NO_QUOTA, new_owner())

    def close(self) -> None:
        """Close the connections to the database."""
        self._engine.dispose()

    def submit(self, scene_id: str, recipe: Recipe, plan: Plan, client: str = "") -> str:
        """Queue a bake; the same recipe under the same code is the same bake, and a failed or canceled one resumes.

        Args:
            scene_id: id of an existing scene. recipe: recipe of the bake.
            plan: cost of the bake. client: user, for fair scheduling.
        Returns:
            The bake's id.
        Raises:
            NotFoundError: there is no such scene.
        """
        identity, now = bake_id(scene_id, recipe), time.time()
        described = {"request": recipe_json(recipe), "plan": _plan_json(plan), "is_first": is_tiny(plan)}
        row = JobRow(
            id=identity,
            kind=BAKE,
            state="queued",
            created=now,
            queued=now,
            scene_id=scene_id,
            code=bake_code(),
            client=client,
            progress=0.0,
            bytes=0,
            **described,
        )
        if not self.exists(identity):
            try:
                with self.sessions.begin() as session:
                    session.add(row)
                return identity
            except IntegrityError:
                if not self.exists(identity):  # not a duplicate: the scene was deleted
                    raise NotFoundError(f"there is no scene {scene_id}; import it first") from None
        is_readable = self.bake(identity).problem != UNREADABLE
        states: Sequence[JobState] = ("failed", "canceled") if is_readable else ("ready", "failed", "canceled")
        self.requeue_bake(identity, states, **described)
        return identity

    def requeue_bake(self, identity: str, states: Sequence[JobState], **values: Any) -> None:
        """Queue a bake that is in one of `states` again, and change other columns."""
        with self.sessions.begin() as session:
            queue_again(session, identity, states, **values)

    def bake(self, identity: str) -> BakeStatus:
        """Return a bake. Raises NotFoundError."""
        row = self.get(BAKE, identity)
        return _status(row, self._queue_positions([row]))

    def bakes(self, scene_id: str | None = None) -> list[BakeStatus]:
        """All bakes, or those of a scene; newest first."""
        query = select(JobRow).where(JobRow.kind == BAKE).order_by(JobRow.created.desc(), JobRow.id)
        if scene_id is not None:
            query = query.where(JobRow.scene_id == scene_id)
        with self.sessions() as session:
            rows = list(session.scalars(query))
        queue_positions = self._queue_positions(rows)
        return [_status(row, queue_positions) for row in rows]

    def bakes_of_scenes(self, scene_ids: Collection[str]) -> dict[str, list[BakeStatus]]:
        """Bakes of some scenes by scene, newest first; one statement, without positions in the queue."""
        query = select(JobRow).where(JobRow.scene_id.in_(scene_ids))
        bakes: dict[str, list[BakeStatus]] = {}
        with self.sessions() as session:
            for row in session.scalars(query.order_by(JobRow.created.desc(), JobRow.id)):
                bakes.setdefault(row.scene_id or "", []).append(_status(row, {}))
        return bakes

    def ready_bakes(self) -> list[str]:
        """Ids of all ready bakes, newest first."""
        query = select(JobRow.id).where(JobRow.kind == BAKE, JobRow.state == "ready")
        with self.sessions() as session:
            return list(session.scalars(query.order_by(JobRow.created.desc(), JobRow.id)))

    def _queue_positions(self, rows: Sequence[JobRow]) -> dict[str, int]:
        """Number of bakes before each queued one: tiny ones never wait for others; clients count with equal shares."""
        if not any(row.state == "queued" for row in rows):
            return {}
        columns = JobRow.id, JobRow.state, JobRow.client, JobRow.is_first, JobRow.queued
        query = select(*columns).where(JobRow.kind == BAKE, JobRow.state.in_(ACTIVE_STATES))
        lanes = defaultdict[bool, list[Waiting]](list)
        with self.sessions() as session:
            for row in session.execute(query):
                work = Waiting(row.id, row.client or "", row.state == "running", row.queued or 0.0)
                lanes[bool(row.is_first)].append(work)
        return {work.id: k for lane in lanes.values() for k, work in enumerate(FairShare({}).sort(lane))}

    def finished_tasks(self, identity: str) -> dict[tuple[int, int], TaskCost]:
        """Costs of a bake's finished tasks by (stage, index)."""
        with self.sessions() as session:
            rows = session.scalars(select(TaskRow).where(TaskRow.bake_id == identity))
            return {(row.stage, row.index): TaskCost(row.rays, row.trace_s, row.seconds) for row in rows}

    def finish_task(self, identity: str, task: Task, cost: TaskCost, attempts: int) -> bool:
        """Record that a task's shards are on disk; idempotent.

        Args:
            identity: id of the bake. task: the finished task.
            cost: seconds and rays. attempts: number of attempts, including this one.
        Returns:
            False if another owner, perhaps with another unfinished store, has the lease, or the bake is deleted;
            then nothing is recorded.
        """
        row = TaskRow(bake_id=identity, stage=task.stage, index=task.index, attempts=attempts, **asdict(cost))
        with self.sessions.begin() as session:
            if not self._renew_until_commit(session, identity):
                return False
            session.merge(row)
        return True

    def delete_tasks(self, identity: str, *, is_running: bool = False) -> bool:
        """Delete the task rows of a bake whose unfinished store is missing or damaged.

        Args:
            identity: id of the bake. is_running: whether it runs; then only the owner of its lease may do this.
        Returns:
            False if another owner has the lease: nothing is deleted.
        """
        with self.sessions.begin() as session:
            if is_running and not self._renew_until_commit(session, identity):
                return False
            session.execute(delete(TaskRow).where(TaskRow.bake_id == identity))
            session.execute(update(JobRow).where(JobRow.id == identity).values(progress=0.0))
        return True

    def restart(self, identity: str, code: str, run: str, reason: str | None) -> bool:
        """Restart a bake from nothing, under this code.

        Args:
            identity: id of the bake. code: code version of the process that runs it. run: new run marker.
            reason: one sentence, if it had finished tasks.
        Returns:
            False if another owner has the lease, or the bake was canceled.
        """
        is_deleted = self.delete_tasks(identity, is_running=True)
        return is_deleted and self.update_leased(identity, code=code, run=run, problem=reason)

    def finished_bakes(self, limit: int) -> list[CompletedBake]:
        """Measured work of the newest ready bakes."""
        task_s = func.sum(TaskRow.seconds)
        query = (
            select(JobRow.plan, task_s, JobRow.crowding)
            .join(TaskRow, TaskRow.bake_id == JobRow.id)
            .where(JobRow.state == "ready")
            .group_by(JobRow.id, JobRow.plan, JobRow.created, JobRow.crowding)
            .order_by(JobRow.created.desc())
            .limit(limit)
        )
        with self.sessions() as session:
            rows = [(_plan(plan), float(seconds), crowded or 1.0) for plan, seconds, crowded in session.execute(query)]
        return [CompletedBake(plan, seconds, crowded) for plan, seconds, crowded in rows if plan is not None]

    def stage_seconds(self, scene_id: str, method: str, num_workers: int, limit: int) -> dict[int, float]:
        """Time per stage of the newest ready bakes of a method, of this scene if there are any.

        Args:
            scene_id: scene whose bakes are preferred. method: name of the transfer method.
            num_workers: concurrent tasks of bakes that are not tiny.
            limit: number of bakes to read.
        Returns:
            Total wall seconds by stage; empty if there are none.
        """
        is_like = JobRow.request.contains(f'"method":{json.dumps(method)}', autoescape=True)
        newest = select(JobRow.id, JobRow.scene_id, JobRow.is_first)
        newest = newest.where(JobRow.kind == BAKE, JobRow.state == "ready", is_like)
        task_query = select(TaskRow.bake_id, TaskRow.stage, func.sum(TaskRow.seconds), func.count())
        seconds_by_stage: dict[int, float] = {}
        with self.sessions() as session:
            bakes = list(session.execute(newest.order_by(JobRow.created.desc()).limit(limit)))
            similar = [bake for bake in bakes if bake[1] == scene_id] or bakes
            num_parallel = {bake: 1 if is_first else num_workers for bake, _, is_first in similar}
            query = task_query.where(TaskRow.bake_id.in_(num_parallel)).group_by(TaskRow.bake_id, TaskRow.stage)
            for bake, stage, seconds, count in session.execute(query):
                seconds_by_stage[stage] = seconds_by_stage.get(stage, 0.0) + float(seconds) / min(
                    count, num_parallel[bake]
                )
        return seconds_by_stage


def _plan_json(plan: Plan) -> str:
    document = asdict(plan)
    del document["lone_bytes"]  # obsolete; older versions on the same ledger do not know it
    return json.dumps(document)


@lru_cache(maxsize=4096)  # of the same rows, twice a second
def _plan(text: str | None) -> Plan | None:
    """Read a plan; None if it is damaged."""
    try:
        return Plan(**json.loads(text or ""))
    except (ValueError, TypeError):
        return None


@lru_cache(maxsize=4096)
def _recipe(text: str) -> Recipe | None:
    """Read a recipe; None if it is damaged."""
    try:
        return recipe_from_json(text)
    except (ValueError, TypeError, LookupError, AttributeError, RelumeError):
        return None


def _status(row: JobRow, queue_positions: Mapping[str, int]) -> BakeStatus:
    recipe, plan = _recipe(row.request), _plan(row.plan)
    is_readable = recipe is not None and plan is not None
    return BakeStatus(
        id=row.id,
        scene=row.scene_id or "",
        state=cast("JobState", row.state) if is_readable else "failed",
        progress=row.progress or 0.0,
        phase=cast("Phase | None", row.phase),
        phase_since=row.phase_since if row.phase else None,
        queue_position=queue_positions.get(row.id, 0) if row.state == "queued" else 0,
        rays_per_second=row.rays_per_second,
        seconds_left=row.seconds_left,
        bytes=row.bytes or 0,
        problem=row.problem if is_readable else UNREADABLE,
        recipe=recipe or _UNKNOWN_RECIPE,
        plan=plan or _UNKNOWN_PLAN,
        created=row.created,
        client=row.client or "",
        code=row.code,
    )
