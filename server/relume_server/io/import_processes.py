"""Run imports in separate processes, forked from one that has loaded the readers."""

from __future__ import annotations

import json
import logging
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict

from relume.core.errors import DiskFullError, MaterialError, RelumeError, SceneError
from relume_server.io.import_request import ImportRequest
from relume_server.io.importer_zygote import ImportExit
from relume_server.io.sandbox import environment, missing_features

log = logging.getLogger(__name__)
START_S = 120.0  # time that loading may take on a busy machine
_DAMAGED = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGFPE, signal.SIGILL)
_ERRORS_BY_KEY: Mapping[str, Callable[[str], Exception]] = {
    "problem": SceneError,
    "material": MaterialError,
    "full": lambda _: DiskFullError("the imported data"),
    "large": lambda _: ImportTooLargeError("the imported data is too large"),
    "failure": RelumeError,
}
_COMMAND = [sys.executable, "-m", "relume_server.io.importer_zygote"]


class ImportTooLargeError(RelumeError):
    """A file unpacks to more than the limit."""


class Importers:
    """Runs imports, each in a process with limits from the first byte of the file on."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._parent: tuple[subprocess.Popen[bytes], socket.socket] | None = None

    def start(self) -> None:
        """Start the process that others are forked from, if needed; otherwise the first import waits for it."""
        with self._lock:
            self._ensure_running()

    def run(self, request: ImportRequest) -> str:
        """Import into the request's folder; returns the id. Blocks.

        Raises:
            SceneError: the file cannot be used, or exceeds a limit. DiskFullError: the disk is full.
            ImportTooLargeError: the result is too large. RelumeError: an internal error, which is logged.
        """
        asker, child_socket = socket.socketpair()
        with asker:
            with child_socket, self._lock:
                socket.send_fds(self._ensure_running(), [b"."], [child_socket.fileno()])
            return _result(request, _request_import(asker, request))

    def close(self) -> None:
        """End the process that others are forked from; running imports end when their connection closes."""
        with self._lock:
            parent, self._parent = self._parent, None
        if parent is not None:
            process, asking = parent
            asking.close()
            process.kill()
            process.wait()

    def _ensure_running(self) -> socket.socket:
        """Return its socket; start it if it is not running."""
        if self._parent is None or self._parent[0].poll() is not None:
            if self._parent is not None:
                self._parent[1].close()
            self._parent = _start_process()
        return self._parent[1]


def _start_process() -> tuple[subprocess.Popen[bytes], socket.socket]:
    # No thread pools: forks would lack them, and each reserves address space, which counts against the limit.
    environ = environment() | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    if missing_features():
        log.warning(
            "this machine has no %s: imports have limits, but can access other files or the network "
            "(docs/operations.md)",
            " and no ".join(missing_features()),
        )
    asking, child_socket = socket.socketpair()
    with child_socket:
        process = subprocess.Popen(_COMMAND, stdin=child_socket.fileno(), stdout=subprocess.DEVNULL, env=environ)  # noqa: S603
    return process, asking


def _request_import(asker: socket.socket, request: ImportRequest) -> ImportExit:
    """Run an import in a forked process, and return its exit."""
    asker.settimeout(START_S + request.seconds)
    try:
        asker.sendall(json.dumps(asdict(request)).encode() + b"\n")
        with asker.makefile("rb") as answer:
            return ImportExit(**json.loads(answer.read()))
    except TimeoutError:
        return ImportExit(0, "", "", is_late=True)
    except (OSError, ValueError):
        return ImportExit(0, "", "the connection closed before the result", is_late=False)


def _result(request: ImportRequest, import_exit: ImportExit) -> str:
    """Return the id, or raise the error of a process's exit."""
    if -import_exit.code in _DAMAGED:
        _log(import_exit)
        raise SceneError("the file is damaged: its reader crashed; export it again")
    answer = json.loads(import_exit.answer) if import_exit.answer else {}
    if "id" in answer:
        return str(answer["id"])
    for key, make_error in _ERRORS_BY_KEY.items():
        if key in answer:
            if key not in ("problem", "material") and import_exit.output:  # that process has no log
                _log(import_exit)
            raise make_error(answer[key])
    if import_exit.is_late or import_exit.code < 0:
        limits = f"{request.seconds} s or {request.max_bytes / 1e9:.1f} GB"
        raise SceneError(f"the import was stopped: it needs more than {limits}; simplify the file")
    _log(import_exit)
    raise RelumeError("the import failed, but not because of the file; see the server's log, and report it")


def _log(import_exit: ImportExit) -> None:
    line = " ".join(import_exit.output.split())
    log.error("an import process ended with code %d: %s", import_exit.code, line or "nothing")
