"""The process that imports are forked from: it has loaded what they need, which takes seconds, before anybody asks.

`python -m relume_server.io.importer_zygote` has a socket as stdin, and each message there brings the end of another.
For that a keeper is forked, which reads one `ImportRequest` from it as a line of JSON, forks the process that imports,
with limits
from the file's first byte on, and answers with one `End`. `relume_server.io.import_processes` starts it.

Forking is safe because this process has one thread: loading starts none, and what is forked ends without going back.
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
MIN_FILE_BYTES = 1 << 16  # what it says of its end is a file, too
MAX_OPEN_FILES = 1_024  # files at once; a scene has at most 900 companions


@dataclass(frozen=True)
class ImportExit:
    """How a process that imported has ended.

    Attributes:
        code: that it ended with, or minus the signal.
        answer: what `run_import` said, as JSON; empty where it came to nothing.
        output: the end of what it wrote to stderr.
        is_late: whether it was ended for taking too long.
    """

    code: int
    answer: str
    output: str
    is_late: bool


def main() -> None:
    """The process itself: until nobody is left who could ask."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to a whole terminal; the server ends this one
    _load()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # keepers are waited for by who asked
    asking = socket.socket(fileno=sys.stdin.fileno())
    while True:
        message, received_fds, *_ = socket.recv_fds(asking, 1, 1)
        if not message:
            return
        with (
            socket.socket(fileno=received_fds[0]) as asker,
            suppress(OSError),
        ):  # no room for one more: who asks is told none
            if os.fork() == 0:
                asking.close()
                _supervise_import(asker)


def _load() -> None:
    """Load what imports need, readers of scenes as well, while nobody waits for it."""
    import relume.assets.environments.read_environment
    import relume.assets.measured.measured_store
    import relume.images.image_store
    import relume.scene_io.import_scene
    import relume.scene_io.referenced_files  # noqa: F401
    import relume_worker.scenes  # noqa: F401
    from relume_server.io.sandbox import missing_features

    missing_features()


def _supervise_import(asker: socket.socket) -> NoReturn:
    """Be the process that has one file imported, and tells who asked how that ended."""
    try:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        with asker.makefile("rb") as lines:
            request = ImportRequest(**json.loads(lines.readline()))
        asker.sendall(json.dumps(asdict(_run_import(request, asker))).encode())
    finally:  # never back into the loop that it was forked from; who asked sees an end
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
    """What a process tells until it ends; None where it took too long, or who asked is gone."""
    answer, until_s = b"", time.monotonic() + seconds
    while (remaining_s := until_s - time.monotonic()) > 0:
        readable, *_ = select.select([reading, asker.fileno()], [], [], remaining_s)
        if asker.fileno() in readable:  # nothing more is asked: it is closed
            return None
        if reading in readable:
            chunk = os.read(reading, MAX_ANSWER_BYTES)
            if not chunk:
                return answer
            answer = (answer + chunk)[-MAX_ANSWER_BYTES:]
    return None


def _import(request: ImportRequest, writing: int, output: BinaryIO) -> NoReturn:
    """Be the process that imports."""
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
    except MemoryError:  # met where even a sentence takes too much
        os.kill(os.getpid(), signal.SIGKILL)
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    os._exit(0)  # nothing is to be taken apart: it is the other process's


if __name__ == "__main__":
    main()
