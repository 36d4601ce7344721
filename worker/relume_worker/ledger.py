"""The ledger: all bakes, their progress and their owners. It is authoritative; the scheduler is disposable.

    queued ──claim──▶ running ──▶ ready
      ▲                 │ └─────▶ failed     submitting a failed or canceled bake queues it again; finished tasks stay
      └───submit────────┴───────▶ canceled

Every change is one statement that names the state it expects, so that of two racing processes only one succeeds.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from functools import lru_cache
from typing import Any, cast

from sqlalchemy import CursorResult, Engine, delete, func, or_, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session, sessionmaker

from relume.core.errors import NotFoundError
from relume.core.source_hash import bake_code
from relume.store.bake_protocol import Plan, Recipe, Task
from relume_worker.database.clock import epoch_s
from relume_worker.database.models import BakeRow, TaskRow
from relume_worker.estimate import CompletedBake, crowding, machine_load
from relume_worker.executor import is_tiny
from relume_worker.job_state import JobState
from relume_worker.jobs.fair_share import Waiting
from relume_worker.lease import is_alive, log_taken_over
from relume_worker.status import BakeStatus, Phase, TaskCost, bake_id, recipe_from_json, recipe_json


class Ledger:
    """Bakes and their tasks in a database. Safe for several threads and processes."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self.sessions = sessionmaker(engine, expire_on_commit=False)

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
        row = BakeRow(
            id=identity,
            scene_id=scene_id,
            recipe=recipe_json(recipe),
            plan=_plan_json(plan),
            state="queued",
            created=now,
            queued=now,
            code=bake_code(),
            client=client,
        )
        if self._get(identity) is None:
            try:
                with self.sessions.begin() as session:
                    session.add(row)
                return identity
            except IntegrityError:
                if self._get(identity) is None:  # not a duplicate: the scene was deleted
                    raise NotFoundError(f"there is no scene {scene_id}; import it first") from None
        self.requeue(identity, ("failed", "canceled"))
        return identity

    def requeue(self, identity: str, states: Sequence[JobState]) -> None:
        """Queue a bake that is in one of `states` again."""
        self._change(identity, states, state="queued", problem=None, queued=time.time(), seconds_left=None, phase=None)

    def bake(self, identity: str) -> BakeStatus:
        """Return a bake. Raises NotFoundError."""
        row = self._get(identity)
        if row is None:
            raise NotFoundError(f"there is no bake {identity[:40]}; queue one first")
        return _status(row, self._queue_positions([row]))

    def bakes(self, scene_id: str | None = None) -> list[BakeStatus]:
        """All bakes, or those of a scene; newest first."""
        query = select(BakeRow).order_by(BakeRow.created.desc(), BakeRow.id)
        if scene_id is not None:
            query = query.where(BakeRow.scene_id == scene_id)
        with self.sessions() as session:
            rows = list(session.scalars(query))
        queue_positions = self._queue_positions(rows)
        return [_status(row, queue_positions) for row in rows]

    def bakes_of_scenes(self, scene_ids: Collection[str]) -> dict[str, list[BakeStatus]]:
        """Bakes of some scenes by scene, newest first; one statement, without positions in the queue."""
        query = select(BakeRow).where(BakeRow.scene_id.in_(scene_ids))
        bakes: dict[str, list[BakeStatus]] = {}
        with self.sessions() as session:
            for row in session.scalars(query.order_by(BakeRow.created.desc(), BakeRow.id)):
                bakes.setdefault(row.scene_id, []).append(_status(row, {}))
        return bakes

    def ready_bakes(self) -> list[str]:
        """Ids of all ready bakes, newest first."""
        query = select(BakeRow.id).where(BakeRow.state == "ready").order_by(BakeRow.created.desc(), BakeRow.id)
        with self.sessions() as session:
            return list(session.scalars(query))

    def _queue_positions(self, rows: Sequence[BakeRow]) -> dict[str, int]:
        """Number of bakes before each queued one: tiny ones never wait for others; clients count with equal shares."""
        if not any(row.state == "queued" for row in rows):
            return {}
        query = select(BakeRow).where(BakeRow.state.in_(("queued", "running"))).order_by(BakeRow.queued)
        lanes: dict[bool, list[BakeRow]] = {True: [], False: []}
        with self.sessions() as session:
            for row in session.scalars(query):
                lanes[is_tiny(_plan(row.plan))].append(row)
        return {identity: k for rows in lanes.values() for k, identity in enumerate(_fair_order(rows))}

    def cancel(self, identity: str) -> bool:
        """Cancel a queued or running bake; its owner notices at its next heartbeat."""
        return self._change(identity, ("queued", "running"), state="canceled", seconds_left=None, phase=None)

    def claimable(self) -> list[Waiting]:
        """Bakes without a live owner, longest waiting first: queued, or left by a dead owner. `is_first`: tiny ones."""
        columns = BakeRow.id, BakeRow.client, BakeRow.plan, BakeRow.queued, BakeRow.owner, BakeRow.heartbeat
        query = select(*columns, epoch_s().label("now")).where(BakeRow.state.in_(("queued", "running")))
        with self.sessions() as session:
            rows = list(session.execute(query.order_by(BakeRow.queued)))
        is_owned = [_is_owned(row, row.now) for row in rows]
        num_running = Counter(
            (row.client or "", is_tiny(_plan(row.plan))) for row, is_run in zip(rows, is_owned, strict=True) if is_run
        )
        waiting = []
        for row in (row for row, is_run in zip(rows, is_owned, strict=True) if not is_run):
            lane = row.client or "", is_tiny(_plan(row.plan))
            waiting.append(Waiting(row.id, *lane, row.queued, num_running[lane]))
        return waiting

    def claim(self, identity: str, owner: str) -> bool:
        """Take the lease of a bake and set it running. False if another owner has it."""
        with self.sessions() as session:
            row_and_time = session.execute(select(BakeRow, epoch_s()).where(BakeRow.id == identity)).first()
        if row_and_time is None or _is_owned(*row_and_time):
            return False
        row = row_and_time[0]
        is_unchanged = or_(BakeRow.owner.is_(None), BakeRow.owner == row.owner)
        is_claimed = self._change(
            identity,
            ("queued", "running"),
            is_unchanged,
            state="running",
            owner=owner,
            heartbeat=epoch_s(),
            phase=None,
            seconds_left=None,
        )
        if is_claimed and row.owner not in (None, owner):
            log_taken_over("bake", identity, str(row.owner))
        return is_claimed

    def heartbeat(self, identity: str, owner: str, **progress: float | str | None) -> bool:
        """Record progress. False if the bake was canceled or taken over: stop."""
        is_owner = BakeRow.owner == owner
        return self._change(identity, ("running",), is_owner, heartbeat=epoch_s(), **progress)

    def renew_lease(self, identity: str, owner: str) -> bool:
        """Renew the lease of a bake in any state. False if another owner has it."""
        return self._change(identity, None, BakeRow.owner == owner, heartbeat=epoch_s())

    def finish(
        self, identity: str, owner: str, state: JobState, problem: str | None = None, num_bytes: int = 0
    ) -> bool:
        """Give up the lease; a running bake changes to `state`, a canceled one stays canceled.

        Args:
            identity: id of the bake. owner: owner of its lease; otherwise nothing changes.
            state: final state.
            problem: a sentence, if the bake has failed.
            num_bytes: size of the store in bytes, if it is ready.
        Returns:
            As `release`.
        """
        is_owner = BakeRow.owner == owner
        ready_fields = {"progress": 1.0, "crowding": crowding(machine_load())} if state == "ready" else {}
        final_fields = {"problem": problem, "bytes": num_bytes, "seconds_left": None, "phase": None, **ready_fields}
        self._change(identity, ("running",), is_owner, state=state, **final_fields)
        return self.release(identity, owner)

    def release(self, identity: str, owner: str) -> bool:
        """Give up the lease and leave the state: another owner may claim the bake. False if it was lost before."""
        return self._change(identity, None, BakeRow.owner == owner, owner=None)

    def delete_bakes(self, ids: Sequence[str]) -> None:
        """Delete bakes in any state."""
        with self.sessions.begin() as session:
            session.execute(delete(TaskRow).where(TaskRow.bake_id.in_(ids)))
            session.execute(delete(BakeRow).where(BakeRow.id.in_(ids)))

    def finished_tasks(self, identity: str) -> dict[tuple[int, int], TaskCost]:
        """Costs of a bake's finished tasks by (stage, index)."""
        with self.sessions() as session:
            rows = session.scalars(select(TaskRow).where(TaskRow.bake_id == identity))
            return {(row.stage, row.index): TaskCost(row.rays, row.trace_s, row.seconds) for row in rows}

    def finish_task(self, identity: str, owner: str, task: Task, cost: TaskCost, attempts: int) -> bool:
        """Record that a task's shards are on disk; idempotent.

        Args:
            identity: id of the bake. owner: owner of its lease. task: the finished task.
            cost: seconds and rays. attempts: number of attempts, including this one.
        Returns:
            False if another owner, perhaps with another unfinished store, has the lease, or the bake is deleted;
            then nothing is recorded.
        """
        row = TaskRow(bake_id=identity, stage=task.stage, index=task.index, attempts=attempts, **asdict(cost))
        with self.sessions.begin() as session:
            if not _renew(session, identity, owner):
                return False
            session.merge(row)
        return True

    def delete_tasks(self, identity: str, owner: str | None = None) -> bool:
        """Delete the task rows of a bake whose unfinished store is missing or damaged.

        Args:
            identity: id of the bake. owner: owner of its lease; None: nobody runs it.
        Returns:
            False if another owner has the lease: nothing is deleted.
        """
        with self.sessions.begin() as session:
            if owner is not None and not _renew(session, identity, owner):
                return False
            session.execute(delete(TaskRow).where(TaskRow.bake_id == identity))
            session.execute(update(BakeRow).where(BakeRow.id == identity).values(progress=0.0))
        return True

    def get_run(self, identity: str) -> str | None:
        """Run marker of a bake."""
        row = self._get(identity)
        return None if row is None else row.run

    def restart(self, identity: str, owner: str, code: str, run: str, reason: str | None) -> bool:
        """Restart a bake from nothing, under this code.

        Args:
            identity: id of the bake. owner: process that runs it. code: its code version.
            run: new run marker.
            reason: one sentence, if it had finished tasks.
        Returns:
            False if another owner has the lease, or the bake was canceled.
        """
        if not self.delete_tasks(identity, owner):
            return False
        return self._change(identity, ("running",), BakeRow.owner == owner, code=code, run=run, problem=reason)

    def finished_bakes(self, limit: int) -> list[CompletedBake]:
        """Measured work of the newest ready bakes."""
        task_s = func.sum(TaskRow.seconds)
        query = (
            select(BakeRow.plan, task_s, BakeRow.crowding)
            .join(TaskRow, TaskRow.bake_id == BakeRow.id)
            .where(BakeRow.state == "ready")
            .group_by(BakeRow.id, BakeRow.plan, BakeRow.created, BakeRow.crowding)
            .order_by(BakeRow.created.desc())
            .limit(limit)
        )
        with self.sessions() as session:
            rows = list(session.execute(query))
        return [CompletedBake(_plan(plan), float(seconds), crowded or 1.0) for plan, seconds, crowded in rows]

    def stage_seconds(self, scene_id: str, method: str, num_workers: int, limit: int) -> dict[int, float]:
        """Time per stage of the newest ready bakes of a method, of this scene if there are any.

        Args:
            scene_id: scene whose bakes are preferred. method: name of the transfer method.
            num_workers: concurrent tasks of bakes that are not tiny.
            limit: number of bakes to read.
        Returns:
            Total wall seconds by stage; empty if there are none.
        """
        is_like = BakeRow.recipe.contains(f'"method":{json.dumps(method)}', autoescape=True)
        newest = select(BakeRow.id, BakeRow.scene_id, BakeRow.plan).where(BakeRow.state == "ready", is_like)
        task_query = select(TaskRow.bake_id, TaskRow.stage, func.sum(TaskRow.seconds), func.count())
        seconds_by_stage: dict[int, float] = {}
        with self.sessions() as session:
            bakes = list(session.execute(newest.order_by(BakeRow.created.desc()).limit(limit)))
            similar = [bake for bake in bakes if bake[1] == scene_id] or bakes
            num_parallel = {bake: 1 if is_tiny(_plan(plan)) else num_workers for bake, _, plan in similar}
            query = task_query.where(TaskRow.bake_id.in_(num_parallel)).group_by(TaskRow.bake_id, TaskRow.stage)
            for bake, stage, seconds, count in session.execute(query):
                seconds_by_stage[stage] = seconds_by_stage.get(stage, 0.0) + float(seconds) / min(
                    count, num_parallel[bake]
                )
        return seconds_by_stage

    def _get(self, identity: str) -> BakeRow | None:
        with self.sessions() as session:
            return session.get(BakeRow, identity)

    def _change(self, identity: str, states: Sequence[JobState] | None, *conditions: Any, **values: Any) -> bool:
        statement = update(BakeRow).where(BakeRow.id == identity, *conditions).values(**values)
        if states is not None:
            statement = statement.where(BakeRow.state.in_(states))
        with self.sessions.begin() as session:
            return cast("CursorResult[Any]", _execute(session, statement)).rowcount == 1


def _renew(session: Session, identity: str, owner: str) -> bool:
    """Renew a lease; true if the owner holds it until the transaction ends."""
    statement = update(BakeRow).where(BakeRow.id == identity, BakeRow.owner == owner).values(heartbeat=epoch_s())
    return cast("CursorResult[Any]", _execute(session, statement)).rowcount == 1


def _execute(session: Session, statement: Any) -> Any:
    return session.execute(statement, execution_options={"synchronize_session": False})


def _is_owned(row: Any, now: float) -> bool:
    return row.owner is not None and is_alive(row.owner, row.heartbeat, now)


def _fair_order(rows: Sequence[BakeRow]) -> list[str]:
    """Ids in scheduling order: priority first, then each client's first, each one's second, …; `rows` by submission."""
    counts = Counter[str]()
    ranks = []
    for row in sorted(rows, key=lambda row: row.state != "running"):
        ranks.append((row.state != "running", counts[row.client or ""], row.queued, row.id))
        counts[row.client or ""] += 1
    return [identity for *_, identity in sorted(ranks)]


def _plan_json(plan: Plan) -> str:
    document = asdict(plan)
    del document["lone_bytes"]  # obsolete; older versions on the same ledger do not know it
    return json.dumps(document)


@lru_cache(maxsize=4096)  # of the same rows, twice a second
def _plan(text: str) -> Plan:
    return Plan(**json.loads(text))


def _status(row: BakeRow, queue_positions: Mapping[str, int]) -> BakeStatus:
    return BakeStatus(
        id=row.id,
        scene=row.scene_id,
        state=cast("JobState", row.state),
        progress=row.progress,
        phase=cast("Phase | None", row.phase),
        phase_since=row.phase_since if row.phase else None,
        queue_position=queue_positions.get(row.id, 0) if row.state == "queued" else 0,
        rays_per_second=row.rays_per_second,
        seconds_left=row.seconds_left,
        bytes=row.bytes,
        problem=row.problem,
        recipe=recipe_from_json(row.recipe),
        plan=_plan(row.plan),
        created=row.created,
        client=row.client or "",
        code=row.code,
    )
