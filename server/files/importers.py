"""Processes that import, each for one file; some have begun before anybody asks, for that takes seconds."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict

from relume.errors import DatabaseDamagedError, DiskFullError, RelumeError, SceneError, StorageError
from server.files.importing import DAMAGED, MAX_OUTPUT_BYTES, ImportRequest
from worker.database.faults import away_elsewhere

log = logging.getLogger(__name__)
MAX_SAID_BYTES = 2_000
_FAULTS: Mapping[str, Callable[[str], Exception]] = {
    "problem": SceneError,
    "full": lambda _: DiskFullError("what was imported"),
    "storage": StorageError,
    "away": away_elsewhere,
    "damaged": DatabaseDamagedError,
    "failure": RelumeError,
}
_COMMAND = [sys.executable, "-m", "server.files.importing"]


class Importers:
    """Imports files, each in a process of its own, which has its limits from the first byte of the file on.

    Args:
        num_waiting: processes that wait for files, beside those that read some.
    """

    def __init__(self, num_waiting: int) -> None:
        self._num_waiting, self._lock = num_waiting, threading.Lock()
        self._waiting: list[subprocess.Popen[bytes]] = []
        self._is_closed = False

    def start(self) -> None:
        """Have as many wait as shall, in the place of those that were taken or have ended."""
        with self._lock:
            self._waiting = [process for process in self._waiting if process.poll() is None]
            while len(self._waiting) < self._num_waiting and not self._is_closed:
                self._waiting.append(_begin())

    def run(self, request: ImportRequest) -> str:
        """Import and register; returns the id. Blocks.

        Raises:
            SceneError: the file cannot be used, or reading it took too much. DiskFullError: there is no room for it.
            StorageError, OperationalError, DatabaseDamagedError: of the service. RelumeError: a defect; it is logged.
        """
        self.start()
        with self._lock:
            process = self._waiting.pop(0) if self._waiting else _begin()
        self.start()
        return _ask(process, request)

    def close(self) -> None:
        """End those that wait."""
        with self._lock:
            self._is_closed = True
            waiting, self._waiting = self._waiting, []
        for process in waiting:
            process.kill()
            process.communicate()


def _begin() -> subprocess.Popen[bytes]:
    # No thread pools in a short-lived process: each thread would reserve address space that counts against the limit.
    environ = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(  # noqa: S603
        _COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environ
    )


def _ask(process: subprocess.Popen[bytes], request: ImportRequest) -> str:
    told, said, is_late = b"", b"", False
    try:
        told, said = process.communicate(json.dumps(asdict(request)).encode(), request.seconds)
    except subprocess.TimeoutExpired:
        is_late = True
        process.kill()
        process.communicate()
    return _result(request, process.returncode, told, said, is_late)


def _result(request: ImportRequest, code: int, told: bytes, said: bytes, is_late: bool) -> str:
    """The id; or raise what a process's end means.

    Args:
        code: that it ended with, or minus the signal. told, said: what it wrote to stdout and to stderr.
        is_late: whether it was ended for taking too long.
    """
    if -code in DAMAGED:
        _log_end(code, said)
        raise SceneError("the file made its reader fail, it is damaged; export it again")
    try:
        answer = json.loads(told[-MAX_OUTPUT_BYTES:].splitlines()[-1])
    except (ValueError, IndexError):
        answer = {}
    if "id" in answer:
        return str(answer["id"])
    for key, fault in _FAULTS.items():
        if key in answer:
            raise fault(answer[key])
    if is_late or code < 0 or said.rstrip().endswith(b"MemoryError"):
        limits = f"{request.seconds} s or {request.max_bytes / 1e9:.1f} GB"
        raise SceneError(f"the import was stopped: it needs more than {limits}; simplify the file")
    _log_end(code, said)
    raise RelumeError("the import failed, and not because of the file; the server's log says why, report it")


def _log_end(code: int, said: bytes) -> None:
    line = " ".join(said[-MAX_SAID_BYTES:].decode(errors="replace").split())
    log.error("the process of an import ended with %d and said: %s", code, line or "nothing")
