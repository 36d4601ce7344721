"""The server's side of one batch process: start, run steps, stop, kill."""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from relume.core.errors import CancelledError, DiskFullError, NotFoundError, RelumeError, StoreError, StoreNotFoundError
from relume.core.memory_usage import resident_bytes
from relume.image_io.ocio.active_config import config_source
from relume_server.batch.step import IsNeeded, ProgressCallback, Step

COMMAND = ["-m", "relume_server.batch.process_main"]


class _NoRoomError(DiskFullError):
    """A step found the disk full; with its message."""

    def __init__(self, message: str) -> None:
        RelumeError.__init__(self, message)


_ERRORS_BY_KIND: Mapping[str, type[RelumeError]] = {
    "store-not-found": StoreNotFoundError,
    "store": StoreError,
    "not-found": NotFoundError,
    "disk": _NoRoomError,
}
"""Expected errors of a step, which do not end its process, by the last part of the problem's type."""
_POLL_S = 0.1
_STOP_S = 1.0  # a kernel may run for longer than anyone wants to wait
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class ProcessExitedError(RelumeError):
    """The process ended during a step."""


class BatchProcess:
    """Runs one step at a time; used by one thread at a time."""

    def __init__(self, data: Path, num_bytes: int, num_threads: int, niceness: int) -> None:
        """
        Args:
            data: data directory. num_bytes: cache of the process. num_threads: number of threads of its kernels.
            niceness: niceness of the process, 0…19.
        """
        numbers = map(str, (num_bytes, num_threads, niceness))
        command = [sys.executable, *COMMAND, str(data.resolve()), *numbers, *config_source()]
        # a process group of its own: Ctrl-C goes to the server only, and children can be killed together
        self._process = subprocess.Popen(  # noqa: S603
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, process_group=0,
            env=os.environ | dict.fromkeys(_THREAD_VARIABLES, "1"),
        )  # fmt: skip
        assert self._process.stdin is not None
        self._pipe = self._process.stdin
        self.num_steps, self.idle_since_s = 0, time.monotonic()
        self._messages: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._has_ended = threading.Event()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        """True if the process accepts steps; an exiting one closes its pipe before it is gone."""
        return not self._has_ended.is_set() and self._process.poll() is None

    def resident_bytes(self) -> int:
        """Resident memory in bytes."""
        return resident_bytes(self.pid) if self.is_alive else 0

    def do(self, step: Step, report: ProgressCallback, is_needed: IsNeeded) -> Mapping[str, Any]:
        """Run a step, see `RunStep`. Raises ProcessExitedError if the process ended."""
        self.num_steps += 1
        self._send(asdict(step))
        while is_needed():
            with suppress(queue.Empty):
                message = self._messages.get(timeout=_POLL_S)
                if message is None:
                    raise ProcessExitedError(f"the process of the {step.kind} ended")
                if "share" not in message:
                    return _answer(message)
                report(message["share"])
        self._stop()
        raise CancelledError(f"the {step.kind} was stopped")

    def _stop(self) -> None:
        """Stop the step in time, if necessary by killing the process."""
        with suppress(ProcessExitedError):
            self._send("stop")
        until_s = time.monotonic() + _STOP_S
        while (remaining_s := until_s - time.monotonic()) > 0:
            with suppress(queue.Empty):
                message = self._messages.get(timeout=remaining_s)
                if message is None or "share" not in message:
                    return
        self.kill()

    def kill(self) -> None:
        """Kill the process and its children."""
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        self._process.wait()
        self._listener.join()
        with suppress(OSError):  # unread output
            self._pipe.close()

    def _send(self, message: Any) -> None:
        try:
            self._pipe.write(json.dumps(message) + "\n")
            self._pipe.flush()
        except OSError:
            raise ProcessExitedError("the process ended before the step") from None

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines, suppress(ValueError):  # killed while writing a line
            for line in lines:
                self._messages.put(json.loads(line))
        self._has_ended.set()
        self._messages.put(None)


def _answer(message: Mapping[str, Any]) -> Mapping[str, Any]:
    if "canceled" in message:
        raise CancelledError("the step was stopped")
    if "problem" in message:
        raise _ERRORS_BY_KIND.get(message.get("kind", ""), RelumeError)(message["problem"])
    answer: Mapping[str, Any] = message["answer"]
    return answer
