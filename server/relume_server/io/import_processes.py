"""Imports files, each in a process of its own, forked from one that has loaded what that takes."""

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
START_S = 120.0  # that a busy machine may take to load what imports need
_DAMAGED = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGFPE, signal.SIGILL)
_ERRORS_BY_KEY: Mapping[str, Callable[[str], Exception]] = {
    "problem": SceneError,
    "material": MaterialError,
    "full": lambda _: DiskFullError("what was imported"),
    "large": lambda _: ImportTooLargeError("what was imported is larger than there is room for"),
    "failure": RelumeError,
}
_COMMAND = [sys.executable, "-m", "relume_server.io.importer_zygote"]


class ImportTooLargeError(RelumeError):
    """A file unpacks to more than it may take."""


class Importers:
    """Imports files, each in a process of its own, which has its limits from the first byte of the file on."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._parent: tuple[subprocess.Popen[bytes], socket.socket] | None = None

    def start(self) -> None:
        """Have the process run that others are forked from, unless it does; the first import else waits for it."""
        with self._lock:
            self._ensure_running()

    def run(self, request: ImportRequest) -> str:
        """Import into the request's folder; returns the id. Blocks.

        Raises:
            SceneError: the file cannot be used, or reading it took too much. DiskFullError: there is no room for it.
            OutgrownError: it takes more than it may. RelumeError: a defect; it is logged.
        """
        asker, child_socket = socket.socketpair()
        with asker:
            with child_socket, self._lock:
                socket.send_fds(self._ensure_running(), [b"."], [child_socket.fileno()])
            return _result(request, _request_import(asker, request))

    def close(self) -> None:
        """End the process that others are forked from; they end with who asked."""
        with self._lock:
            parent, self._parent = self._parent, None
        if parent is not None:
            process, asking = parent
            asking.close()
            process.kill()
            process.wait()

    def _ensure_running(self) -> socket.socket:
        """Where it is asked; it is begun where it does not run."""
        if self._parent is None or self._parent[0].poll() is not None:
            if self._parent is not None:
                self._parent[1].close()
            self._parent = _start_process()
        return self._parent[1]


def _start_process() -> tuple[subprocess.Popen[bytes], socket.socket]:
    # No thread pools: what is forked would lack them, and each reserves address space, which counts against the limit.
    environ = environment() | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    if missing_features():
        log.warning(
            "this machine has no %s: what reads uploads has limits, and is not kept from other files or the network "
            "(docs/operations.md)",
            " and no ".join(missing_features()),
        )
    asking, child_socket = socket.socketpair()
    with child_socket:
        process = subprocess.Popen(_COMMAND, stdin=child_socket.fileno(), stdout=subprocess.DEVNULL, env=environ)  # noqa: S603
    return process, asking


def _request_import(asker: socket.socket, request: ImportRequest) -> ImportExit:
    """How the process ended that was forked for this."""
    asker.settimeout(START_S + request.seconds)
    try:
        asker.sendall(json.dumps(asdict(request)).encode() + b"\n")
        with asker.makefile("rb") as answer:
            return ImportExit(**json.loads(answer.read()))
    except TimeoutError:
        return ImportExit(0, "", "", is_late=True)
    except (OSError, ValueError):
        return ImportExit(0, "", "it has gone before it could tell how it ended", is_late=False)


def _result(request: ImportRequest, import_exit: ImportExit) -> str:
    """The id; or raise what a process's end means."""
    if -import_exit.code in _DAMAGED:
        _log(import_exit)
        raise SceneError("the file made its reader fail, it is damaged; export it again")
    answer = json.loads(import_exit.answer) if import_exit.answer else {}
    if "id" in answer:
        return str(answer["id"])
    for key, make_error in _ERRORS_BY_KEY.items():
        if key in answer:
            if key not in ("problem", "material") and import_exit.output:  # it has no log of its own
                _log(import_exit)
            raise make_error(answer[key])
    if import_exit.is_late or import_exit.code < 0:
        limits = f"{request.seconds} s or {request.max_bytes / 1e9:.1f} GB"
        raise SceneError(f"the import was stopped: it needs more than {limits}; simplify the file")
    _log(import_exit)
    raise RelumeError("the import failed, and not because of the file; the server's log says why, report it")


def _log(import_exit: ImportExit) -> None:
    line = " ".join(import_exit.output.split())
    log.error("the process of an import ended with %d and said: %s", import_exit.code, line or "nothing")
