"""Number of glibc arenas that the threads of a server allocate from."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys

import pytest

from relume_server import app
from relume_server.settings import Settings

COUNT = """
import ctypes, sys, threading
from pathlib import Path
from relume.core.memory_usage import limit_malloc_arenas
if sys.argv[2] == "shared":
    limit_malloc_arenas()
libc, all_run = ctypes.CDLL(None), threading.Barrier(13)
libc.malloc.argtypes, libc.malloc.restype = [ctypes.c_size_t], ctypes.c_void_p
libc.fopen.restype = ctypes.c_void_p
libc.malloc_info.argtypes, libc.fclose.argtypes = [ctypes.c_int, ctypes.c_void_p], [ctypes.c_void_p]
def allocate():
    libc.malloc(5000)
    all_run.wait()
for thread in [threading.Thread(target=allocate) for _ in range(12)]:
    thread.start()
all_run.wait()
file = libc.fopen(sys.argv[1].encode(), b"w")
libc.malloc_info(0, file)
libc.fclose(file)
print(Path(sys.argv[1]).read_text().count("<heap nr="))
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="only glibc has arenas")
@pytest.mark.parametrize(
    ("how", "requested", "max_arenas"), [("shared", None, 2), ("alone", None, None), ("shared", "5", 5)]
)
def test_threads_limit_malloc_arenas(tmp_path, how: str, requested: str | None, max_arenas: int | None) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "MALLOC_ARENA_MAX"}
    if requested is not None:
        environment["MALLOC_ARENA_MAX"] = requested
    command = [sys.executable, "-c", COUNT, str(tmp_path / "info.xml"), how]
    count = int(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)
    assert count == max_arenas if max_arenas is not None else count > 5


def test_a_server_limits_its_malloc_arenas(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    done: list[str] = []
    monkeypatch.setattr(app, "set_up", lambda *_: None)
    monkeypatch.setattr(app, "limit_malloc_arenas", lambda: done.append("arenas"))

    class Stub:
        def run(self) -> None:
            done.append("run")

    monkeypatch.setattr(app, "create_server", lambda *_: Stub())
    app.serve(Settings(data=tmp_path))
    assert done == ["arenas", "run"]
