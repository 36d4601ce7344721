"""Pool of batch processes: started on demand, ended when idle, replaced when they grow."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from relume.core.errors import CancelledError, RelumeError
from relume_server.batch.process import BatchProcess, ProcessExitedError
from relume_server.batch.step import IsNeeded, ProgressCallback, Step

MAX_STEPS = 500  # steps after which a process is replaced, whatever its size
_PROGRAM_BYTES = 1 << 30  # compiled kernels, an open bake and Embree's trees: besides cached results
_POLL_S = 0.1
_TRIES = 2


class ProcessPool:
    """Runs a limited number of steps at once: interactive ones first, otherwise first come, first served."""

    def __init__(
        self, data: Path, num_processes: int, num_bytes: int, num_threads: int, niceness: int, idle_s: float
    ) -> None:
        """
        Args:
            data: data directory. num_processes: maximum.
            num_bytes: cache of each process. num_threads: number of threads of the kernels in each.
            niceness: niceness of the processes, 0…19.
            idle_s: lifetime of an idle process.
        """
        self._data, self._num_processes = data, num_processes
        self._limits, self._idle_s = (num_bytes, num_threads, niceness), idle_s
        self._changed = threading.Condition()
        self._ticket_numbers = itertools.count()
        self._waiting: list[tuple[bool, int]] = []
        self._free: list[BatchProcess] = []
        self._busy: set[BatchProcess] = set()
        self._num_free_slots = num_processes
        self._is_closed = False

    def run(self, step: Step, report: ProgressCallback, is_needed: IsNeeded) -> Mapping[str, Any]:
        """Run a step, see `RunStep`."""
        self._acquire_slot(step, is_needed)
        try:
            for _ in range(_TRIES):
                try:
                    return self._run_in_process(step, report, is_needed)
                except ProcessExitedError:
                    continue
        finally:
            with self._changed:
                self._num_free_slots += 1
                self._changed.notify_all()
        raise RelumeError(
            f"the process of the {step.kind} was killed twice, perhaps because memory ran out; give a "
            "smaller size, or free memory and try again"
        )

    def release(self) -> None:
        """End idle processes."""
        long_ago = time.monotonic() - self._idle_s
        with self._changed:
            idle = [process for process in self._free if process.idle_since_s < long_ago]
            self._free = [process for process in self._free if process not in idle]
        for process in idle:
            process.kill()

    def resident_bytes(self) -> int:
        """Resident memory of all processes, in bytes."""
        with self._changed:
            processes = [*self._free, *self._busy]
        return sum(process.resident_bytes() for process in processes)

    def pids(self) -> list[int]:
        """Process ids."""
        with self._changed:
            return [process.pid for process in (*self._free, *self._busy)]

    def close(self) -> None:
        """End all processes; a running step fails."""
        with self._changed:
            self._is_closed = True
            processes, self._free = [*self._free, *self._busy], []
            self._changed.notify_all()
        for process in processes:
            process.kill()

    def _acquire_slot(self, step: Step, is_needed: IsNeeded) -> None:
        with self._changed:
            ticket = not step.is_first, next(self._ticket_numbers)
            self._waiting.append(ticket)
            try:
                while self._num_free_slots == 0 or ticket != min(self._waiting):
                    if self._is_closed or not is_needed():
                        raise CancelledError(f"the {step.kind} was stopped before it started")
                    self._changed.wait(_POLL_S)
                self._num_free_slots -= 1
            finally:
                self._waiting.remove(ticket)
                self._changed.notify_all()

    def _run_in_process(self, step: Step, report: ProgressCallback, is_needed: IsNeeded) -> Mapping[str, Any]:
        process = self._acquire_process()
        try:
            return process.do(step, report, is_needed)
        finally:
            self._return_process(process)

    def _acquire_process(self) -> BatchProcess:
        with self._changed:
            if self._is_closed:
                raise CancelledError("the server is closing")
            while self._free:
                process = self._free.pop()
                if process.is_alive:
                    break
                process.kill()  # remaining time
            else:
                process = BatchProcess(self._data, *self._limits)
            self._busy.add(process)
            return process

    def _return_process(self, process: BatchProcess) -> None:
        """Keep the process for the next step, or end it if it has grown."""
        num_bytes = process.resident_bytes()
        is_reusable = (
            process.is_alive and num_bytes <= self._limits[0] + _PROGRAM_BYTES and process.num_steps < MAX_STEPS
        )
        with self._changed:
            self._busy.discard(process)
            is_reusable = is_reusable and not self._is_closed
            if is_reusable:
                process.idle_since_s = time.monotonic()
                self._free.append(process)
        if not is_reusable:
            process.kill()
