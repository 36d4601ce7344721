"""Process that imports are forked from: it loads the readers once, which takes seconds.

`python -m relume_server.io.importer_zygote` has a socket as stdin; each message on it contains the end of another
socket, for which a supervisor is forked. The supervisor reads one `ImportRequest` as a line of JSON, forks the import
process, with limits from the file's first byte on, and answers with one `ImportExit`.
`relume_server.io.import_processes` starts it.

Forking is safe because this process has one thread: loading starts none, and forked processes exit without returning.
"""

from __future__ import annotations

import json
import os
import resource
import select
import signal
import socket
import sys
import tempfile
import time
import traceback
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import BinaryIO, NoReturn

from relume_server.io.import_request import ImportRequest, run_import
from relume_server.io.sandbox import confine

MAX_ANSWER_BYTES, MAX_OUTPUT_BYTES = 64 * 1024, 2_000
MIN_FILE_BYTES = 1 << 16  # its exit report is a file as well
MAX_OPEN_FILES = 1_024  # open files; a scene has at most 900 companions


@dataclass(frozen=True)
class ImportExit:
    """Exit of an import process.

    Attributes:
        code: exit code, or minus the signal.
        answer: result of `run_import` as JSON; empty if there was none.
        output: end of its stderr.
        is_late: whether it was killed for exceeding its time.
    """

    code: int
    answer: str
    output: str
    is_late: bool


def main() -> None:
    """Main loop, until the server closes the socket."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to the whole terminal; the server ends this process
    _load()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # supervisors are waited for by the server
    asking = socket.socket(fileno=sys.stdin.fileno())
    while True:
        message, received_fds, *_ = socket.recv_fds(asking, 1, 1)
        if not message:
            return
        with (
            socket.socket(fileno=received_fds[0]) as asker,
            suppress(OSError),
        ):  # too many processes: the server gets no answer
            if os.fork() == 0:
                asking.close()
                _supervise_import(asker)


def _load() -> None:
    """Load the readers in advance."""
    import relume.assets.environments.read_environment
    import relume.assets.ies.ies_store
    import relume.assets.measured.measured_store
    import relume.images.image_store
    import relume.scene_io.import_scene
    import relume.scene_io.referenced_files  # noqa: F401
    import relume_worker.scenes  # noqa: F401
    from relume.scene_io.obj_ply.weld import compile_kernels
    from relume_server.io.sandbox import missing_features

    compile_kernels()  # in the sandbox, they could not be saved
    missing_features()


def _supervise_import(asker: socket.socket) -> NoReturn:
    """Supervise one import, and report its exit."""
    try:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        with asker.makefile("rb") as lines:
            request = ImportRequest(**json.loads(lines.readline()))
        asker.sendall(json.dumps(asdict(_run_import(request, asker))).encode())
    finally:  # never return into the loop of the parent; the server sees the connection close
        os._exit(0)


def _run_import(request: ImportRequest, asker: socket.socket) -> ImportExit:
    reading, writing = os.pipe()
    with tempfile.TemporaryFile() as output:
        if (process := os.fork()) == 0:
            asker.close()
            os.close(reading)
            _import(request, writing, output)
        os.close(writing)
        answer = _read_answer(reading, asker, request.seconds)
        os.kill(process, signal.SIGKILL)
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        output.seek(max(0, output.seek(0, os.SEEK_END) - MAX_OUTPUT_BYTES))
        return ImportExit(code, (answer or b"").decode(), output.read().decode(errors="replace"), answer is None)


def _read_answer(reading: int, asker: socket.socket, seconds: float) -> bytes | None:
    """Read the output of a process until it ends; None if it takes too long, or the server is gone."""
    answer, until_s = b"", time.monotonic() + seconds
    while (remaining_s := until_s - time.monotonic()) > 0:
        readable, *_ = select.select([reading, asker.fileno()], [], [], remaining_s)
        if asker.fileno() in readable:  # no more requests: closed
            return None
        if reading in readable:
            chunk = os.read(reading, MAX_ANSWER_BYTES)
            if not chunk:
                return answer
            answer = (answer + chunk)[-MAX_ANSWER_BYTES:]
    return None


def _import(request: ImportRequest, writing: int, output: BinaryIO) -> NoReturn:
    """Body of the import process."""
    os.dup2(output.fileno(), 1)
    os.dup2(output.fileno(), 2)
    try:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (request.seconds, request.seconds))
        resource.setrlimit(resource.RLIMIT_AS, (request.max_bytes, request.max_bytes))
        max_bytes = max(request.max_file_bytes, MIN_FILE_BYTES)
        resource.setrlimit(resource.RLIMIT_FSIZE, (max_bytes, max_bytes))
        resource.setrlimit(resource.RLIMIT_NOFILE, (MAX_OPEN_FILES, MAX_OPEN_FILES))
        confine(request.input_files, Path(request.into))
        answer = json.dumps(run_import(request)).encode()
        while answer:
            answer = answer[os.write(writing, answer) :]
    except MemoryError:  # raised when not even the message fits into memory
        os.kill(os.getpid(), signal.SIGKILL)
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    os._exit(0)  # skip cleanup, which belongs to the parent process


if __name__ == "__main__":
    main()
