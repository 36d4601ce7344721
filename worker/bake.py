"""Runs one bake: stages in order, what is not done goes to an executor, what is finished goes into the ledger.

Killed at any moment, the next run continues where the ledger stands and the published store is the same, bit for bit:
a task is pure, its shards appear by rename, and only a recorded task counts as done.
"""

from __future__ import annotations

import logging
import shutil
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from concurrent.futures import CancelledError as FutureCancelledError
from contextlib import suppress
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

from relume.bake import Task
from relume.errors import (
    CancelledError,
    ChunkDamagedError,
    DiskFullError,
    NotFoundError,
    RelumeError,
    StorageError,
    bytes_text,
    is_no_room,
)
from relume.folders import folder_bytes
from relume.replacing import remove_folder
from relume.scene.model import Scene
from relume.store import code_of, fill, open_store, publish
from relume.store.room import check_room
from worker.database.patience import Given, Result, patiently
from worker.lease import HEARTBEAT_S, LeaseKeeper, log_lost
from worker.ledger import Ledger
from worker.notes import forget_note, read_note
from worker.paths import bake_path, staging_path
from worker.progress import Expected, Progress
from worker.runs import begin_run, forget_run, name_run, run_of
from worker.status import Phase, TaskCost
from worker.storage import push
from worker.storage.parts import Parts, fetch_parts, forget_parts
from worker.tasks import Job, idle_timer, run_task, scene_of

SCHEDULER_LOST = "the scheduler went away; start it, then bake again; finished parts are kept"
UPGRADED = "relume has changed since this bake was begun; it starts again, so that its parts are of one version"
TAKEN_OVER = "another machine had begun this bake; it starts again here"
log = logging.getLogger(__name__)

MAX_ATTEMPTS = 3
SAID_ONCE_S = 1.0


@dataclass
class BakeRunner:
    """One run of a bake whose lease `owner` holds.

    Attributes:
        window: how many tasks may be handed out at once now; the rest wait here, so that a cancel takes effect at once.
        changed: called after every change of the ledger.
        stopped: the service is closing; the bake stays `running` for the next start.
        expected: what finished bakes tell of this one.
        working_since: when its first task began, by `time.monotonic`; None before.
    """

    ledger: Ledger
    job: Job
    owner: str
    executor: Executor
    window: Callable[[], int]
    changed: Callable[[], None] = lambda: None
    stopped: Callable[[], bool] = lambda: False
    expected: Expected = field(default_factory=Expected)
    working_since: float | None = None
    _flying: dict[Future[TaskCost], tuple[Task, int]] = field(default_factory=dict)
    _entered: tuple[Phase | None, float] = (None, 0.0)
    _parts: Parts | None = None
    _lost_s: float = -inf

    def run(self) -> None:
        """Bake and publish; every failure ends in the ledger as a state and a sentence."""
        with LeaseKeeper(self.ledger.keep_lease, self.job.bake_id, self.owner), idle_timer.kept_awake():
            forget_note(self._staging)  # of an earlier run
            self._run()
            forget_note(self._staging)
        self.changed()

    def _run(self) -> None:
        identity = self.job.bake_id
        try:
            num_bytes = self._bake()
            push(self._target)
            self._hold()
            forget_run(self._staging)
            with suppress(StorageError):  # the bake is there; what is left over is deleted with its scene
                forget_parts(identity)
        except CancelledError:
            self._land()
            is_held = self._ask(self.ledger.release, identity, self.owner)
        except Exception as error:  # whatever a method raises must not end the service
            self._land()
            if not self._is_there():  # deleted in the middle of a task, with what that wrote to
                return
            if not isinstance(error, RelumeError | OSError):
                log.exception("bake %s failed", identity, extra={"fields": {"bake": identity}})
            is_held = self._ask(self.ledger.finish, identity, self.owner, "failed", self._sentence(error))
        else:
            is_held = self._ask(self.ledger.finish, identity, self.owner, "ready", num_bytes=num_bytes)
        if not is_held and self._is_there():
            log_lost("bake", identity)

    def _hold(self) -> None:
        """Renew the lease before files are changed that another process, if it has the bake now, goes on with.

        Raises:
            CancelledError: it has.
        """
        if not self._ask(self.ledger.keep_lease, self.job.bake_id, self.owner):
            raise CancelledError("another process has the bake")

    def _bake(self) -> int:
        job, target, staging = self.job, self._target, self._staging
        if target.exists():  # published, and then killed before the ledger knew
            return folder_bytes(target)
        self._begin_or_go_on()
        status = self._ask(self.ledger.bake, job.bake_id)
        shown = status.progress if self._ask(self.ledger.finished_tasks, job.bake_id) else 0.0
        progress = Progress(status.plan, shown, self.expected)
        self._beat(progress, "reading")
        scene = job.recipe.seen(scene_of(job.data_dir, job.scene_id))
        fill.begin(job.method, scene, job.recipe, staging)
        for stage in range(len(job.method.stages)):
            self._run_stage(scene, stage, progress)
        self._beat(progress, "publishing")
        try:
            return publish(staging, target, self._hold)
        except ChunkDamagedError:
            if self._ask(self.ledger.forget_tasks, job.bake_id, self.owner):
                shutil.rmtree(staging, ignore_errors=True)
            raise

    def _begin_or_go_on(self) -> None:
        """Keep what an earlier run has finished where it is here and of the same code; else start from nothing."""
        identity, staging = self.job.bake_id, self._staging
        run = self._ask(self.ledger.run, identity)
        is_here = staging.exists() and run_of(staging) == run
        finished = self._ask(self.ledger.finished_tasks, identity)
        if not is_here and run is not None and fetch_parts(staging, identity, run, finished):
            is_here = True
            name_run(staging, run)
        if is_here and code_of(staging) == self.job.code:
            self._parts = Parts(staging, identity, run, finished) if run is not None else None
            return
        # where nothing is finished, what is here is left of one that was deleted
        why = None if not finished else UPGRADED if is_here else TAKEN_OVER
        if why is not None:
            log.warning("bake %s: %s", identity, why, extra={"fields": {"bake": identity}})
        self._hold()
        shutil.rmtree(staging, ignore_errors=True)
        run = begin_run(staging)
        if not self._ask(self.ledger.begin_anew, identity, self.owner, self.job.code, run, why):
            raise CancelledError("the bake was stopped")
        self._parts = Parts(staging, identity, run, ())

    def _run_stage(self, scene: Scene, stage: int, progress: Progress) -> None:
        job = self.job
        tasks = fill.begin_stage(job.method, scene, job.recipe, self._staging, stage)
        progress.begin_stage(tasks, last=stage == len(job.method.stages) - 1)
        done = self._ask(self.ledger.finished_tasks, job.bake_id)
        waiting: deque[tuple[Task, int]] = deque()
        for task in tasks:
            if (cost := done.get((stage, task.index))) is not None:
                progress.add(task, cost, here=False)
            else:
                waiting.append((task, 1))
        self._beat(progress, self._phase(stage, progress))
        while waiting or self._flying:
            check_room(job.data_dir)
            room = self._room(len(waiting))
            while waiting and room > 0:
                room -= 1
                task, attempt = waiting.popleft()
                self._flying[self.executor.submit(run_task, job, task)] = task, attempt
            finished, _ = wait(self._flying, timeout=HEARTBEAT_S, return_when=FIRST_COMPLETED)
            for future in finished:
                self._collect(future, waiting, progress)
            self._beat(progress, self._phase(stage, progress))

    def _room(self, num_waiting: int) -> int:
        """How many tasks more may be handed out. Of the last none waits behind another at one process while the next is
        idle: a stage may have but one long task for each view."""
        num_flying, most = len(self._flying), self.window()
        return (most if num_waiting + num_flying > most else max(1, most // 2)) - num_flying

    def _phase(self, stage: int, progress: Progress) -> Phase:
        """What the processes are at: until one of them works, what they do to get ready."""
        note = read_note(self._staging)
        if note == "compiling":
            return note
        if self.working_since is None and note != "working":
            return note or "loading"
        if self.working_since is None:
            self.working_since = time.monotonic()
            progress.begin_work()
        return "sampling" if stage == 0 else "tracing"

    def _collect(self, future: Future[TaskCost], waiting: deque[tuple[Task, int]], progress: Progress) -> None:
        task, attempt = self._flying.pop(future)
        try:
            cost = future.result()
        except FutureCancelledError as error:  # nobody here cancels a task
            self._flying.clear()  # handed out while the scheduler went away, they would never end
            raise RelumeError(SCHEDULER_LOST) from error
        except Exception as error:
            if not _is_lost_process(error):
                raise
            if attempt == MAX_ATTEMPTS:
                raise RelumeError(
                    f"{attempt} worker processes died of the same task, most likely for want of memory; free memory "
                    "or take fewer lights or a smaller size, then bake again; finished parts are kept"
                ) from error
            self._say_lost()
            waiting.append((task, attempt + 1))
            return
        self._record(task, cost, attempt)
        self.working_since = self.working_since or time.monotonic() - cost.seconds
        progress.add(task, cost, here=True)

    def _say_lost(self) -> None:
        """Once of a process, which had more than one task."""
        now_s = time.monotonic()
        if now_s > self._lost_s + SAID_ONCE_S:
            about = {"fields": {"bake": self.job.bake_id}}
            log.warning("a worker process died; what it was at is given to another", extra=about)
        self._lost_s = now_s

    def _record(self, task: Task, cost: TaskCost, attempt: int) -> None:
        """A task is finished: its shards are stored, where others may go on with them, before it counts."""
        if self._parts is not None:
            self._parts.store((task.stage, task.index))
        if not self._ask(self.ledger.finish_task, self.job.bake_id, self.owner, task, cost, attempt):
            raise CancelledError("the bake was deleted, or another process has it")

    def _beat(self, progress: Progress, phase: Phase) -> None:
        """Record progress; raise CancelledError where somebody wants this run to end."""
        if phase != self._entered[0]:
            self._entered = phase, time.time()
        entered = dict(zip(("phase", "phase_since"), self._entered, strict=True))
        if self.stopped() or not self._ask(
            self.ledger.beat, self.job.bake_id, self.owner, **progress.fields(), **entered
        ):
            raise CancelledError("the bake was stopped")
        self.changed()

    def _land(self) -> None:
        """Wait for the tasks that run and keep what they finished; they would write after us otherwise."""
        deadline = time.monotonic() + (0 if self.stopped() else 600)
        while self._flying and time.monotonic() < deadline:
            finished, _ = wait(self._flying, timeout=HEARTBEAT_S, return_when=FIRST_COMPLETED)
            for future in finished:
                task, attempt = self._flying.pop(future)
                if not future.cancelled() and future.exception() is None:
                    try:
                        self._record(task, future.result(), attempt)
                    except CancelledError:
                        return

    def _ask(self, call: Callable[Given, Result], *args: Given.args, **kwargs: Given.kwargs) -> Result:
        """Call the ledger; one that is away for a while delays the bake and ends nothing."""
        return patiently(self.stopped, call, *args, **kwargs)

    def _is_there(self) -> bool:
        try:
            self._ask(self.ledger.bake, self.job.bake_id)
        except NotFoundError:
            return False
        return True

    def _sentence(self, error: Exception) -> str:
        """What went wrong and what to do, in one line."""
        if isinstance(error, DiskFullError) or (isinstance(error, OSError) and is_no_room(error)):
            needed = self._ask(self.ledger.bake, self.job.bake_id).plan.planned_bytes
            missing = bytes_text(max(1_000_000, needed - folder_bytes(self._staging)))
            return f"disk full; free {missing}, then bake again; finished parts are kept"
        if isinstance(error, RelumeError):
            return " ".join(str(error).split())
        if type(error).__name__ == "CommClosedError":  # submitting met a closed connection
            return SCHEDULER_LOST
        if isinstance(error, MemoryError):
            return "out of memory; take fewer lights or a smaller size, then bake again; finished parts are kept"
        if isinstance(error, OSError):
            return f"a file cannot be read or written ({error.strerror}); see to it, then bake again"
        return f"a defect: {type(error).__name__}: {str(error)[:200]}; the log has the trace"

    @property
    def _target(self) -> Path:
        return bake_path(self.job.data_dir, self.job.bake_id)

    @property
    def _staging(self) -> Path:
        return staging_path(self.job.data_dir, self.job.bake_id)


def _is_lost_process(error: Exception) -> bool:
    """Whether a task ended because its process did."""
    if isinstance(error, BrokenExecutor):
        return True
    return type(error).__name__ in ("KilledWorker", "CommClosedError")


def check_published(path: Path) -> bool:
    """Whether a bake's store is there and can be opened; one that cannot is removed, so that it is baked again."""
    try:
        open_store(path)
    except RelumeError:
        with suppress(OSError):
            remove_folder(path)
        return False
    return True
