"""Bakes as a kind of jobs: one at a time of the small ones, and one of the others, which all worker processes share."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Collection, Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from relume.core.errors import DiskFullError, ParameterError, RelumeError, bytes_text, is_disk_full
from relume.core.folder_size import folder_bytes
from relume.core.source_hash import bake_code
from relume.store.bake_protocol import BakeMethod, Plan
from relume_worker.estimate import crowding, estimate_seconds, machine_load
from relume_worker.executor import Executors, is_tiny
from relume_worker.jobs.fair_share import Waiting
from relume_worker.jobs.job import BAKE, UNREADABLE, NotReadyError
from relume_worker.jobs.kind import Kind
from relume_worker.ledger import Ledger
from relume_worker.paths import staging_path
from relume_worker.progress import ExpectedWork
from relume_worker.run_marker import delete_run
from relume_worker.runner import SCHEDULER_LOST_MESSAGE, BakeRunner
from relume_worker.status import BakeStatus
from relume_worker.status_bus import BlockedBake
from relume_worker.tasks import BakeInput

START_S = 8.0  # start of worker processes, if none are running: measured on two cores
NUM_REFERENCE_BAKES = 8  # finished bakes used for an estimate


class BakeKind(Kind):
    """Runs the tasks of bakes, in this process or on a cluster."""

    name = BAKE

    def __init__(
        self,
        data_dir: Path,
        ledger: Ledger,
        executors: Executors,
        methods: Mapping[str, BakeMethod] | None,
        on_change: Callable[[], None],
        is_closing: Callable[[], bool],
    ) -> None:
        """
        Args:
            data_dir: data directory. ledger: of the bakes. executors: run the tasks.
            methods: available methods by name; None: relume's registry.
            on_change: called after every change of a bake. is_closing: polled; bakes stay `running` for the next start.
        """
        self._data_dir, self._ledger, self.executors = data_dir, ledger, executors
        self._methods, self._on_change, self._is_closing = methods, on_change, is_closing
        self._is_crowding = threading.Event()
        self._start_s = START_S
        self.blocked = BlockedBake()

    def on_deleted(self, identity: str) -> None:
        """Delete what tasks wrote after the files had been deleted."""
        staging = staging_path(self._data_dir, identity)
        shutil.rmtree(staging, ignore_errors=True)
        delete_run(staging)

    def has_room(self, work: Waiting, running: Collection[Waiting]) -> bool:
        """One at a time: a bake takes all cores; small ones have a lane of their own, and never wait for a long one."""
        return not running

    def perform(self, work: Waiting) -> Mapping[str, Any]:
        """Run the unfinished tasks of a bake, and publish it."""
        self.blocked.report_resumed(work.id)
        self._on_change()
        status, start_s, is_cold = self._ledger.bake(work.id), time.monotonic(), not self.executors.has_cluster
        if status.problem == UNREADABLE:
            raise NotReadyError(UNREADABLE)
        method, executors, tiny = self.method(status.recipe.method), self.executors, work.is_first
        expected_work = self._expect_work(status, 1 if tiny else executors.num_workers)
        if not tiny:
            self._ledger.update_leased(status.id, phase="starting", phase_since=time.time())
            self._on_change()
        with nullcontext() if tiny else executors.keep_cluster():
            runner = BakeRunner(
                ledger=self._ledger,
                bake=BakeInput(self._data_dir, status.id, status.scene, status.recipe, method, bake_code()),
                executor=executors.local() if tiny else executors.cluster(),
                max_in_flight=(lambda: 1) if tiny else (lambda: 2 * executors.num_processes()),
                on_change=self._on_change,
                is_stopped=self._is_closing,
                expected_work=expected_work,
            )
            if tiny:
                return runner.run()
            self._is_crowding.set()
            try:
                return runner.run()
            finally:
                self._is_crowding.clear()
                if is_cold and runner.working_since is not None:
                    self._start_s = runner.working_since - start_s

    def error_text(self, identity: str, error: Exception) -> str:
        """Error and remedy, in one line."""
        if isinstance(error, DiskFullError) or (isinstance(error, OSError) and is_disk_full(error)):
            written_bytes = folder_bytes(staging_path(self._data_dir, identity))
            missing_bytes = max(1_000_000, self._ledger.bake(identity).plan.planned_bytes - written_bytes)
            return f"disk full; free {bytes_text(missing_bytes)}, then bake again; finished tasks are saved"
        if isinstance(error, RelumeError):
            return " ".join(str(error).split())
        if type(error).__name__ == "CommClosedError":  # the connection closed while submitting
            return SCHEDULER_LOST_MESSAGE
        if isinstance(error, MemoryError):
            return "out of memory; give fewer lights or a smaller size, then bake again; finished tasks are saved"
        if isinstance(error, OSError):
            return f"a file cannot be read or written ({error.strerror}); fix this, then bake again"
        return f"internal error: {type(error).__name__}: {str(error)[:200]}; the log has the traceback"

    def on_ready(self, identity: str) -> None:
        """Notify subscribers."""
        self._on_change()

    def on_failed(self, identity: str) -> None:
        """Notify subscribers."""
        self._on_change()

    def on_blocked(self, identity: str, error: Exception) -> None:
        """Keep the reason, which the ledger cannot store."""
        self.blocked.report_blocked(self._ledger.bake(identity), error)

    def method(self, name: str) -> BakeMethod:
        """Return a transfer method. Raises ParameterError."""
        if self._methods is None:
            from relume.methods.registry import METHODS

            self._methods = METHODS
        if name not in self._methods:
            raise ParameterError("method", name, f"one of {', '.join(sorted(self._methods))}")
        return self._methods[name]

    def estimate_seconds(self, plan: Plan) -> float | None:
        """Estimate the seconds of a bake from finished bakes; None if there are none.

        Includes starting processes and loading kernels.
        """
        work_s = self._work_s(plan)
        is_cold = not is_tiny(plan) and not self.executors.has_cluster
        return work_s if work_s is None or not is_cold else work_s + self._start_s

    def _work_s(self, plan: Plan) -> float | None:
        """Seconds from the start of the first task."""
        num_workers, load = self.executors.num_workers, machine_load()
        if is_tiny(plan) or not self._is_crowding.is_set():  # a bake that ends before this one would count twice
            load += num_workers
        return estimate_seconds(plan, self._ledger.finished_bakes(NUM_REFERENCE_BAKES), num_workers, crowding(load))

    def _expect_work(self, status: BakeStatus, parallel: int) -> ExpectedWork:
        method, num_workers = self.method(status.recipe.method), self.executors.num_workers
        seconds = self._ledger.stage_seconds(status.scene, method.name, num_workers, NUM_REFERENCE_BAKES)
        total, stages = sum(seconds.values()), range(len(method.stages))
        stage_fractions = [seconds.get(stage, 0.0) / total for stage in stages] if total else None
        return ExpectedWork(self._work_s(status.plan), stage_fractions, parallel)
