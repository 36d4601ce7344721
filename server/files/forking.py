"""The process that imports are forked from: it has loaded what they need, which takes seconds, before anybody asks.

`python -m server.files.forking` has a socket as stdin, and each message there brings the end of another. For that a
keeper is forked, which reads one `ImportRequest` from it as a line of JSON, forks the process that imports, with limits
from the file's first byte on, and answers with one `End`. `server.files.importers` starts it.

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

from server.files.confining import confine
from server.files.importing import ImportRequest, answer_of

MAX_ANSWER_BYTES, MAX_SAID_BYTES = 64 * 1024, 2_000
LEAST_FILE_BYTES = 1 << 16  # what it says of its end is a file, too
MAX_OPEN = 1_024  # files at once; a scene has at most 900 companions


@dataclass(frozen=True)
class End:
    """How a process that imported has ended.

    Attributes:
        code: that it ended with, or minus the signal.
        told: what `answer_of` said, as JSON; empty where it came to nothing.
        said: the end of what it wrote to stderr.
        is_late: whether it was ended for taking too long.
    """

    code: int
    told: str
    said: str
    is_late: bool


def main() -> None:
    """The process itself: until nobody is left who could ask."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to a whole terminal; the server ends this one
    _load()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # keepers are waited for by who asked
    asking = socket.socket(fileno=sys.stdin.fileno())
    while True:
        message, brought, *_ = socket.recv_fds(asking, 1, 1)
        if not message:
            return
        with (
            socket.socket(fileno=brought[0]) as asker,
            suppress(OSError),
        ):  # no room for one more: who asks is told none
            if os.fork() == 0:
                asking.close()
                _keep(asker)


def _load() -> None:
    """Load what imports need, readers of scenes as well, while nobody waits for it."""
    import relume.environments.reading
    import relume.images.shelf
    import relume.measured.asset_store
    import relume.scene.companions
    import relume.scene.importer  # noqa: F401
    import worker.scenes  # noqa: F401
    from server.files.confining import missing

    missing()


def _keep(asker: socket.socket) -> NoReturn:
    """Be the process that has one file imported, and tells who asked how that ended."""
    try:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        with asker.makefile("rb") as lines:
            request = ImportRequest(**json.loads(lines.readline()))
        asker.sendall(json.dumps(asdict(_end(request, asker))).encode())
    finally:  # never back into the loop that it was forked from; who asked sees an end
        os._exit(0)


def _end(request: ImportRequest, asker: socket.socket) -> End:
    reading, writing = os.pipe()
    with tempfile.TemporaryFile() as said:
        if (process := os.fork()) == 0:
            asker.close()
            os.close(reading)
            _import(request, writing, said)
        os.close(writing)
        told = _told(reading, asker, request.seconds)
        os.kill(process, signal.SIGKILL)
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        said.seek(max(0, said.seek(0, os.SEEK_END) - MAX_SAID_BYTES))
        return End(code, (told or b"").decode(), said.read().decode(errors="replace"), told is None)


def _told(reading: int, asker: socket.socket, seconds: float) -> bytes | None:
    """What a process tells until it ends; None where it took too long, or who asked is gone."""
    told, until_s = b"", time.monotonic() + seconds
    while (left_s := until_s - time.monotonic()) > 0:
        ready, *_ = select.select([reading, asker.fileno()], [], [], left_s)
        if asker.fileno() in ready:  # nothing more is asked: it is closed
            return None
        if reading in ready:
            piece = os.read(reading, MAX_ANSWER_BYTES)
            if not piece:
                return told
            told = (told + piece)[-MAX_ANSWER_BYTES:]
    return None


def _import(request: ImportRequest, writing: int, said: BinaryIO) -> NoReturn:
    """Be the process that imports."""
    os.dup2(said.fileno(), 1)
    os.dup2(said.fileno(), 2)
    try:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (request.seconds, request.seconds))
        resource.setrlimit(resource.RLIMIT_AS, (request.max_bytes, request.max_bytes))
        most_bytes = max(request.max_file_bytes, LEAST_FILE_BYTES)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))
        resource.setrlimit(resource.RLIMIT_NOFILE, (MAX_OPEN, MAX_OPEN))
        confine(request.own, Path(request.into))
        told = json.dumps(answer_of(request)).encode()
        while told:
            told = told[os.write(writing, told) :]
    except MemoryError:  # met where even a sentence takes too much
        os.kill(os.getpid(), signal.SIGKILL)
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    os._exit(0)  # nothing is to be taken apart: it is the other process's


if __name__ == "__main__":
    main()
