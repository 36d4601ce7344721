"""Run one bake: stages in order, unfinished tasks to an executor, finished ones to the ledger.

It can be killed at any time: the next run continues after the tasks in the ledger, and the published store is the same,
bit for bit: a task is pure, its shards appear by rename, and only a recorded task counts as done.
"""

from __future__ import annotations

import logging
import shutil
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from concurrent.futures import CancelledError as FutureCancelledError
from contextlib import suppress
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any

from relume.core.errors import CancelledError, ChunkDamagedError, RelumeError, StorageError
from relume.core.filesystem import remove_folder
from relume.core.folder_size import folder_bytes
from relume.scene.model import Scene
from relume.store import run_bake
from relume.store.bake_protocol import Task
from relume.store.disk_space import check_disk_space
from relume.store.publish import publish
from relume.store.reader import open_store, read_code
from relume_worker.database.retry import Given, Result, with_retry
from relume_worker.estimate import crowding, machine_load
from relume_worker.jobs.job import BAKE
from relume_worker.lease import HEARTBEAT_S
from relume_worker.ledger import Ledger
from relume_worker.paths import bake_path, staging_path
from relume_worker.progress import ExpectedWork, Progress
from relume_worker.run_marker import delete_run, get_run, set_run, start_run
from relume_worker.status import Phase, TaskCost
from relume_worker.storage import push
from relume_worker.storage.partial_uploads import PartialUploads, delete_partial, fetch_partial
from relume_worker.task_notes import delete_note, read_note
from relume_worker.tasks import BakeInput, idle_timer, load_registered_scene, run_task

SCHEDULER_LOST_MESSAGE = "the scheduler is gone; start it, then try again; finished tasks are saved"
CODE_CHANGED_MESSAGE = (
    "relume was updated since this bake started; it starts again, because one version must make all of it"
)
TAKEN_OVER_MESSAGE = "another machine had started this bake; it starts again here"
log = logging.getLogger(__name__)

MAX_ATTEMPTS = 3
LOSS_LOG_INTERVAL_S = 1.0


@dataclass
class BakeRunner:
    """One run of a bake whose lease the ledger has.

    Attributes:
        max_in_flight: maximum number of submitted tasks; the rest wait here, so that canceling is immediate.
        on_change: called after every change of the ledger.
        is_stopped: the service is closing; the bake stays `running` for the next start.
        expected_work: from finished bakes.
        working_since: start of its first task, by `time.monotonic`; None before.
    """

    ledger: Ledger
    bake: BakeInput
    executor: Executor
    max_in_flight: Callable[[], int]
    on_change: Callable[[], None] = lambda: None
    is_stopped: Callable[[], bool] = lambda: False
    expected_work: ExpectedWork = field(default_factory=ExpectedWork)
    working_since: float | None = None
    _in_flight: dict[Future[TaskCost], tuple[Task, int]] = field(default_factory=dict)
    _phase_entered: tuple[Phase | None, float] = (None, 0.0)
    _partial_uploads: PartialUploads | None = None
    _last_loss_s: float = -inf

    def run(self) -> Mapping[str, Any]:
        """Bake and publish.

        Returns:
            Columns of the bake's row when it is ready.
        Raises:
            CancelledError: it was canceled, deleted or taken over, or the service is closing. Any other exception: it
                has failed; finished tasks are in the ledger.
        """
        with idle_timer.keep_awake():
            delete_note(self._staging)  # of an earlier run
            try:
                num_bytes = self._bake()
                push(self._target)
                self._renew_lease()
                delete_run(self._staging)
                with suppress(StorageError):  # the bake is published; leftovers are deleted with its scene
                    delete_partial(self.bake.bake_id)
            except Exception:
                self._drain()
                raise
            finally:
                delete_note(self._staging)
        return {"progress": 1.0, "crowding": crowding(machine_load()), "bytes": num_bytes}

    def _renew_lease(self) -> None:
        """Renew the lease before changing files that another process, if it has the bake now, uses.

        Raises:
            CancelledError: another process has the bake.
        """
        if not self._call_ledger(self.ledger.renew_lease, self.bake.bake_id):
            raise CancelledError("another process has the bake")

    def _bake(self) -> int:
        bake, target, staging = self.bake, self._target, self._staging
        if target.exists():  # published, and then killed before the ledger was updated
            return folder_bytes(target)
        self._start_or_resume()
        status = self._call_ledger(self.ledger.bake, bake.bake_id)
        initial_progress = status.progress if self._call_ledger(self.ledger.finished_tasks, bake.bake_id) else 0.0
        progress = Progress(status.plan, initial_progress, self.expected_work)
        self._heartbeat(progress, "reading")
        scene = bake.recipe.add_cameras(load_registered_scene(bake.data_dir, bake.scene_id))
        run_bake.create_staging_store(bake.method, scene, bake.recipe, staging)
        for stage in range(len(bake.method.stages)):
            self._run_stage(scene, stage, progress)
        self._heartbeat(progress, "publishing")
        try:
            return publish(staging, target, self._renew_lease)
        except ChunkDamagedError:
            if self._call_ledger(self.ledger.delete_tasks, bake.bake_id, is_running=True):
                shutil.rmtree(staging, ignore_errors=True)
            raise

    def _start_or_resume(self) -> None:
        """Resume an earlier run if it is here and by the same code; otherwise start from nothing."""
        identity, staging = self.bake.bake_id, self._staging
        run = self._call_ledger(self.ledger.get, BAKE, identity).run
        is_local = staging.exists() and get_run(staging) == run
        finished_tasks = self._call_ledger(self.ledger.finished_tasks, identity)
        if not is_local and run is not None and fetch_partial(staging, identity, run, finished_tasks):
            is_local = True
            set_run(staging, run)
        if is_local and read_code(staging) == self.bake.code:
            self._partial_uploads = PartialUploads(staging, identity, run, finished_tasks) if run is not None else None
            return
        # without finished tasks, files here are leftovers of a deleted bake
        reason = None if not finished_tasks else CODE_CHANGED_MESSAGE if is_local else TAKEN_OVER_MESSAGE
        if reason is not None:
            log.warning("bake %s: %s", identity, reason, extra={"fields": {"bake": identity}})
        self._renew_lease()
        shutil.rmtree(staging, ignore_errors=True)
        run = start_run(staging)
        if not self._call_ledger(self.ledger.restart, identity, self.bake.code, run, reason):
            raise CancelledError("the bake was stopped")
        self._partial_uploads = PartialUploads(staging, identity, run, ())

    def _run_stage(self, scene: Scene, stage: int, progress: Progress) -> None:
        bake = self.bake
        tasks = run_bake.create_stage(bake.method, scene, bake.recipe, self._staging, stage)
        progress.begin_stage(tasks, last=stage == len(bake.method.stages) - 1)
        finished_costs = self._call_ledger(self.ledger.finished_tasks, bake.bake_id)
        pending: deque[tuple[Task, int]] = deque()
        for task in tasks:
            if (cost := finished_costs.get((stage, task.index))) is not None:
                progress.add(task, cost, is_local=False)
            else:
                pending.append((task, 1))
        self._heartbeat(progress, self._phase(stage, progress))
        while pending or self._in_flight:
            check_disk_space(bake.data_dir)
            num_free = self._num_free_slots(len(pending))
            while pending and num_free > 0:
                num_free -= 1
                task, attempt = pending.popleft()
                self._in_flight[self.executor.submit(run_task, bake, task)] = task, attempt
            done_futures, _ = wait(self._in_flight, timeout=HEARTBEAT_S, return_when=FIRST_COMPLETED)
            for future in done_futures:
                self._collect(future, pending, progress)
            self._heartbeat(progress, self._phase(stage, progress))

    def _num_free_slots(self, num_pending: int) -> int:
        """Number of tasks to submit now. The last ones are spread, so that none waits behind another in one process
        while the next is idle: a stage may have a single long task per view.
        """
        num_in_flight, max_tasks = len(self._in_flight), self.max_in_flight()
        return (max_tasks if num_pending + num_in_flight > max_tasks else max(1, max_tasks // 2)) - num_in_flight

    def _phase(self, stage: int, progress: Progress) -> Phase:
        """Current phase: until a process computes, its preparation."""
        note = read_note(self._staging)
        if note == "compiling":
            return note
        if self.working_since is None and note != "working":
            return note or "loading"
        if self.working_since is None:
            self.working_since = time.monotonic()
            progress.begin_work()
        return "sampling" if stage == 0 else "tracing"

    def _collect(self, future: Future[TaskCost], pending: deque[tuple[Task, int]], progress: Progress) -> None:
        task, attempt = self._in_flight.pop(future)
        try:
            cost = future.result()
        except FutureCancelledError as error:  # nobody here cancels a task
            self._in_flight.clear()  # submitted while the scheduler disappeared, they would never end
            raise RelumeError(SCHEDULER_LOST_MESSAGE) from error
        except Exception as error:
            if not is_lost_process(error):
                raise
            if attempt == MAX_ATTEMPTS:
                raise RelumeError(
                    f"{attempt} worker processes died in the same task, most likely because memory ran out; free "
                    "memory, or give fewer lights or a smaller size, then bake again; finished tasks are saved"
                ) from error
            self._log_lost_worker()
            pending.append((task, attempt + 1))
            return
        self._record(task, cost, attempt)
        self.working_since = self.working_since or time.monotonic() - cost.seconds
        progress.add(task, cost, is_local=True)

    def _log_lost_worker(self) -> None:
        """Log a dead process once, though it had several tasks."""
        now_s = time.monotonic()
        if now_s > self._last_loss_s + LOSS_LOG_INTERVAL_S:
            extra = {"fields": {"bake": self.bake.bake_id}}
            log.warning("a worker process died; its tasks go to another", extra=extra)
        self._last_loss_s = now_s

    def _record(self, task: Task, cost: TaskCost, attempt: int) -> None:
        """Record a finished task, after its shards are stored where other machines find them."""
        if self._partial_uploads is not None:
            self._partial_uploads.store((task.stage, task.index))
        if not self._call_ledger(self.ledger.finish_task, self.bake.bake_id, task, cost, attempt):
            raise CancelledError("the bake was deleted, or another process has it")

    def _heartbeat(self, progress: Progress, phase: Phase) -> None:
        """Record progress; raise CancelledError if this run should end."""
        if phase != self._phase_entered[0]:
            self._phase_entered = phase, time.time()
        entered = dict(zip(("phase", "phase_since"), self._phase_entered, strict=True))
        fields = {"state": "running", **progress.fields(), **entered}
        if self.is_stopped() or not self._call_ledger(self.ledger.update_leased, self.bake.bake_id, **fields):
            raise CancelledError("the bake was stopped")
        self.on_change()

    def _drain(self) -> None:
        """Wait for running tasks and record them; otherwise they would write after this run has ended."""
        deadline = time.monotonic() + (0 if self.is_stopped() else 600)
        while self._in_flight and time.monotonic() < deadline:
            done_futures, _ = wait(self._in_flight, timeout=HEARTBEAT_S, return_when=FIRST_COMPLETED)
            for future in done_futures:
                task, attempt = self._in_flight.pop(future)
                if not future.cancelled() and future.exception() is None:
                    try:
                        self._record(task, future.result(), attempt)
                    except CancelledError:
                        return

    def _call_ledger(self, call: Callable[Given, Result], *args: Given.args, **kwargs: Given.kwargs) -> Result:
        """Call the ledger; an outage delays the bake, and does not end it."""
        return with_retry(self.is_stopped, call, *args, **kwargs)

    @property
    def _target(self) -> Path:
        return bake_path(self.bake.data_dir, self.bake.bake_id)

    @property
    def _staging(self) -> Path:
        return staging_path(self.bake.data_dir, self.bake.bake_id)


def is_lost_process(error: Exception) -> bool:
    """True if a task ended because its process did."""
    if isinstance(error, BrokenExecutor):
        return True
    return type(error).__name__ in ("KilledWorker", "CommClosedError")


def check_published(path: Path) -> bool:
    """True if a bake's store exists and can be opened; a damaged one is removed, so that it is baked again."""
    try:
        open_store(path)
    except RelumeError:
        with suppress(OSError):
            remove_folder(path)
        return False
    return True
