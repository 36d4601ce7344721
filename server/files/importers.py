"""Processes that import, each for one file; some have begun before anybody asks, for that takes seconds."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import asdict

from relume.errors import DiskFullError, SceneError
from server.files.importing import DAMAGED, MAX_OUTPUT_BYTES, ImportRequest

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
    told = b""
    with suppress(subprocess.TimeoutExpired):
        told, _ = process.communicate(json.dumps(asdict(request)).encode(), request.seconds)
    if process.returncode is None:
        process.kill()
        process.communicate()
    if -process.returncode in DAMAGED:
        raise SceneError("the file made its reader fail, it is damaged; export it again")
    try:
        answer = json.loads(told[-MAX_OUTPUT_BYTES:].splitlines()[-1])
    except (ValueError, IndexError):
        limits = f"{request.seconds} s or {request.max_bytes / 1e9:.1f} GB"
        raise SceneError(f"the import was stopped: it needs more than {limits}; simplify the file") from None
    if "full" in answer:
        raise DiskFullError("what was imported")
    if "problem" in answer:
        raise SceneError(answer["problem"])
    return str(answer["id"])
