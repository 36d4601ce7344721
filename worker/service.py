"""The bake service: what the server and the command line use. It owns the threads that run bakes; the ledger and the
stores own everything that must survive them."""

from __future__ import annotations

import logging
import shutil
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from sqlalchemy.exc import SQLAlchemyError

from relume.bake import BakeMethod, Plan, Recipe
from relume.code_version import bake_code
from relume.errors import NotFoundError, ParameterError, StorageError
from relume.store import code_of
from worker.backup.restore import refuse_unfinished
from worker.bake import BakeRunner, check_published
from worker.board import Hindered, StatusBoard, Subscription
from worker.budget import check_budget
from worker.database import open_database
from worker.database.faults import Complaint
from worker.estimate import crowding, load_of_machine, seconds_for
from worker.executor import Executors, is_tiny
from worker.idle import idle_seconds
from worker.lease import new_owner
from worker.ledger import Ledger
from worker.notes import forget_note
from worker.paths import bake_path, scene_path
from worker.progress import Expected
from worker.runs import forget_run, run_of
from worker.status import BakeStatus, bake_id
from worker.storage import configured, is_elsewhere, push
from worker.storage.parts import forget_parts
from worker.tasks import Job, idle_timer, scene_of
from worker.turns import Turns

log = logging.getLogger(__name__)

POLL_S = 1.0
CLOSE_S = 10.0
KEPT_S = 7 * 86_400.0  # what a failed or cancelled bake has finished, for whoever asks for it again
START_S = 8.0  # until worker processes are at work, where none has been started yet: measured on two cores
NUM_JUDGED_BY = 8  # finished bakes that an estimate looks at


class BakeService:
    """Queues, runs and follows bakes. Several services may share a data directory and a ledger."""

    def __init__(
        self,
        data_dir: Path,
        ledger_url: str | None = None,
        scheduler: str | None = None,
        num_workers: int | None = None,
        methods: Mapping[str, BakeMethod] | None = None,
        shares: Mapping[str, float] | None = None,
    ) -> None:
        """
        Args:
            data_dir: folder of scenes and bakes; made where it is missing.
            ledger_url: of SQLite or PostgreSQL; None: relume.db in the data directory.
            scheduler: address of a Dask scheduler; None: an embedded cluster, started by the first bake that needs it.
            num_workers: processes of the embedded cluster; None: one per core.
            methods: what can be baked, by name; None: relume's registry.
            shares: of some clients, see `worker.turns.Turns`.
        """
        configured()  # what is wrong with its address is said before anything runs
        bake_code()  # of what runs now: its files may be exchanged while it does
        self.data_dir = data_dir.resolve()
        self.data_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
        refuse_unfinished(self.data_dir)
        self.ledger = Ledger(open_database(ledger_url or f"sqlite:///{self.data_dir / 'relume.db'}"))
        self._methods = methods
        self._executors = Executors(scheduler, num_workers)
        self._hindered = Hindered()
        self._board = StatusBoard(self.get)
        self._complaints = {
            tiny: Complaint(log, f"the queue of {kind} cannot be worked on")
            for tiny, kind in ((False, "bakes"), (True, "small bakes"))
        }
        self._owner = new_owner()
        self._closing = threading.Event()
        self._is_crowding = threading.Event()
        self._start_s = START_S
        self._turns = {is_tiny_lane: Turns(shares or {}) for is_tiny_lane in (True, False)}
        self._wakes = {True: threading.Event(), False: threading.Event()}
        self._threads: list[threading.Thread] = []

    def start(self) -> None:
        """Start running bakes: those in the queue, and those that a process left behind when it died."""
        self._remove_strays()
        for tiny in (True, False):
            name = "relume-tiny-bakes" if tiny else "relume-bakes"
            self._threads.append(threading.Thread(target=self._run_lane, args=(tiny,), name=name, daemon=True))
            self._threads[-1].start()

        if configured() is not None:
            self._threads.append(threading.Thread(target=self._store_all, name="relume-storage", daemon=True))
            self._threads[-1].start()

    def close(self) -> None:
        """Stop running bakes; an unfinished one continues at the next start."""
        self._closing.set()
        self._changed()
        for thread in self._threads:
            thread.join(CLOSE_S)
        self._executors.close()
        idle_timer.end()
        self._board.close()
        self.ledger.close()

    def __enter__(self) -> BakeService:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def plan(self, scene_id: str, recipe: Recipe) -> Plan:
        """What a bake would cost, checked against this machine's memory and disk.

        A little of it is baked where its bound on disk is large: a second for the first plan of a scene.

        Raises:
            NotFoundError: there is no such scene.
            PlanError: the recipe does not fit the scene; MemoryBudgetError: it does not fit the machine.
            ParameterError: there is no such method.
        """
        from relume.methods.disk import disk_of

        identity = self._known_scene(scene_id)
        with idle_timer.kept_awake():
            scene = recipe.seen(scene_of(self.data_dir, identity))
            method = self._method(recipe.method)
            plan = method.plan(scene, recipe)
            disk = disk_of(method, scene, recipe, plan)
        plan = replace(plan, disk_bytes=disk.store, scratch_bytes=disk.scratch)
        processes = 1 if is_tiny(plan) else 0 if self._executors.scheduler else self._executors.num_workers
        check_budget(plan, self.data_dir, processes)
        return plan

    def submit(self, scene_id: str, recipe: Recipe, client: str = "") -> str:
        """Queue a bake of `scene_id` by a recipe for a client, and return its id; raises what `plan` raises.

        The same recipe under the same code is the same bake: one that is queued, running or ready stays as it is, one
        that failed or was cancelled goes on where it stopped.
        """
        identity = bake_id(scene_id, recipe)
        if self._is_ready(identity):
            return identity
        self.ledger.submit(scene_id, recipe, self.plan(scene_id, recipe), client)
        self._changed()
        return identity

    def get(self, bake_id: str) -> BakeStatus:
        """A bake. Raises NotFoundError."""
        return self._hindered.told(self.ledger.bake(bake_id))

    def bakes(self, scene_id: str | None = None) -> list[BakeStatus]:
        """All bakes, or those of a scene; newest first."""
        return [self._hindered.told(status) for status in self.ledger.bakes(scene_id)]

    def subscribe(self, bake_id: str) -> Subscription:
        """Follow a bake, whichever process runs it. Raises NotFoundError."""
        return self._board.subscribe(bake_id)

    def cancel(self, bake_id: str) -> bool:
        """Cancel a bake; finished tasks are kept for a resume. False where it is not under way: it stays as it is."""
        self.get(bake_id)
        is_cancelled = self.ledger.cancel(bake_id)
        self._changed()
        return is_cancelled

    def forget(self, bake_id: str) -> None:
        """Delete a bake in whatever state it is, with its store. Raises NotFoundError, StorageError."""
        from worker.scenes import delete_bakes

        self.get(bake_id)
        delete_bakes(self.data_dir, self.ledger, [bake_id])
        self._changed()

    def store_path(self, bake_id: str) -> Path:
        """Where the published store of a bake lies. Raises NotFoundError where the id is malformed."""
        return bake_path(self.data_dir, bake_id)

    def seconds_for(self, plan: Plan) -> float | None:
        """Seconds that a bake will take, by those that took place here; None where there were none.

        Processes that have to be started for it, and to load the kernels, are part of it.
        """
        work_s = self._work_s(plan)
        is_cold = not is_tiny(plan) and not self._executors.has_cluster
        return work_s if work_s is None or not is_cold else work_s + self._start_s

    def _work_s(self, plan: Plan) -> float | None:
        """Seconds from the first task's begin on."""
        load = load_of_machine()
        if is_tiny(plan) or not self._is_crowding.is_set():  # else a bake that ends before this one is counted already
            load += self._executors.num_workers
        finished = self.ledger.finished_bakes(NUM_JUDGED_BY)
        return seconds_for(plan, finished, self._executors.num_workers, crowding(load))

    def _expected(self, status: BakeStatus, parallel: int) -> Expected:
        method = self._method(status.recipe.method)
        seconds = self.ledger.stage_seconds(status.scene, method.name, self._executors.num_workers, NUM_JUDGED_BY)
        total, stages = sum(seconds.values()), range(len(method.stages))
        shares = [seconds.get(stage, 0.0) / total for stage in stages] if total else None
        return Expected(self._work_s(status.plan), shares, parallel)

    def workers_resident_bytes(self) -> int:
        """Memory of the worker processes that this service has started."""
        return self._executors.resident_bytes()

    def _known_scene(self, scene_id: str) -> str:
        from worker.scenes import get_scene

        return get_scene(self.ledger, scene_id).id

    def _method(self, name: str) -> BakeMethod:
        if self._methods is None:
            from relume.methods.registry import METHODS

            self._methods = METHODS
        if name not in self._methods:
            raise ParameterError("method", name, f"one of {', '.join(sorted(self._methods))}")
        return self._methods[name]

    def _is_ready(self, identity: str) -> bool:
        """Whether a bake is finished and its store usable; a lost or damaged store is queued again."""
        try:
            state = self.ledger.bake(identity).state
        except NotFoundError:
            return False
        if state != "ready":
            return False
        if check_published(self.store_path(identity)) or is_elsewhere(self.store_path(identity)):
            return True
        self.ledger.forget_tasks(identity)
        self.ledger.requeue(identity, ("ready",))
        return False

    def _changed(self) -> None:
        self._board.changed()
        for wake in self._wakes.values():
            wake.set()

    def _run_lane(self, tiny: bool) -> None:
        """Run bakes one after another. Tiny ones have a lane of their own: a preview never waits for a long bake."""
        at_work_s = time.monotonic()
        while not self._closing.is_set():
            try:
                self._wakes[tiny].clear()
                has_run = self._run_next(tiny)
                if has_run or not self._hindered:  # a bake that waits for its own lease says nothing of the disk
                    self._complaints[tiny].well()
                if has_run:
                    at_work_s = time.monotonic()
                    continue
                if not tiny and time.monotonic() - at_work_s > idle_seconds():
                    self._executors.stop_cluster()
                self._wakes[tiny].wait(POLL_S)
            except Exception as error:  # the database may be away for a while; the lane must outlive that
                self._complaints[tiny].meet(error)
                self._closing.wait(POLL_S)

    def _run_next(self, tiny: bool) -> bool:
        turns = self._turns[tiny]
        for work in turns.order(self.ledger.claimable()):
            status = self.ledger.bake(work.id)
            try:
                if is_tiny(status.plan) == tiny and self.ledger.claim(work.id, self._owner):
                    self._hindered.over(work.id)
                    turns.take(work.client)
                    self._run(status, tiny)
                    return True
            except Exception as error:
                self._hindered.meet(self.ledger.bake(work.id), error)
                raise
        return False

    def _run(self, status: BakeStatus, tiny: bool) -> None:
        self._board.changed()
        began, is_cold = time.monotonic(), not self._executors.has_cluster
        try:
            method = self._method(status.recipe.method)
            expected = self._expected(status, 1 if tiny else self._executors.num_workers)
            if not tiny:
                self.ledger.beat(status.id, self._owner, phase="starting", phase_since=time.time())
                self._board.changed()
            executor = self._executors.here() if tiny else self._executors.cluster()
        except SQLAlchemyError:  # its lease runs out, and it is claimed again
            raise
        except Exception as error:
            self.ledger.finish(status.id, self._owner, "failed", str(error))
            self._board.changed()
            return
        runner = BakeRunner(
            ledger=self.ledger,
            job=Job(self.data_dir, status.id, status.scene, status.recipe, method, bake_code()),
            owner=self._owner,
            executor=executor,
            window=(lambda: 1) if tiny else (lambda: 2 * self._executors.cluster_threads()),
            changed=self._board.changed,
            stopped=self._closing.is_set,
            expected=expected,
        )
        if tiny:
            runner.run()
            return
        self._is_crowding.set()
        try:
            runner.run()
        finally:
            self._is_crowding.clear()
        if is_cold and runner.working_since is not None:
            self._start_s = runner.working_since - began

    def _store_all(self) -> None:
        """Store what is here and not in the storage: from before there was one, or from while it was away."""
        try:
            statuses = self.ledger.bakes()
            scenes = [scene_path(self.data_dir, scene) for scene in dict.fromkeys(one.scene for one in statuses)]
            ready = [bake_path(self.data_dir, status.id) for status in statuses if status.state == "ready"]
            for path in (path for path in (*scenes, *ready) if path.exists()):
                if self._closing.is_set():
                    return
                push(path)
        except Exception as error:  # bakes go on
            Complaint(log, "what is in the data directory cannot be put into the object storage").meet(error)

    def _remove_strays(self) -> None:
        """Delete unfinished stores that no bake in the ledger will finish, or could only by starting again, and those
        of bakes that were stopped and not asked for again for long."""
        found = list((self.data_dir / "bakes" / "staging").glob("*.zarr"))
        # asked after the folders: of a bake that another process begins meanwhile the row comes first
        states = {status.id: status.state for status in self.ledger.bakes()}
        for folder in found:
            identity = folder.name.removesuffix(".zarr")
            state = states.get(identity, "ready")
            is_stopped = state in ("failed", "cancelled")
            if state == "ready" or (is_stopped and (code_of(folder) != bake_code() or _age_s(folder) > KEPT_S)):
                if is_stopped and run_of(folder) == self.ledger.run(identity):  # else its tasks are another machine's
                    self.ledger.forget_tasks(identity)
                    with suppress(StorageError):  # what is left over is deleted with the bake
                        forget_parts(identity)
                shutil.rmtree(folder, ignore_errors=True)
                forget_note(folder)
                forget_run(folder)


def _age_s(folder: Path) -> float:
    """How long ago anything was written in a folder."""
    latest = max((path.stat().st_mtime for path in (folder, *folder.rglob("*")) if path.exists()), default=0.0)
    return time.time() - latest
