"""Import processes: started in advance, replaced and ended; their results."""

import json
import logging
import os
import signal
import socket
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from relume.core.errors import DiskFullError, MaterialError, RelumeError, SceneError
from relume.core.memory_usage import resident_bytes
from relume_server.errors import make_problem
from relume_server.io import import_processes
from relume_server.io.import_processes import Importers, ImportTooLargeError
from relume_server.io.import_request import ImportRequest
from relume_server.io.sandbox import missing_features

STAND_IN = """
import importlib, os, signal, time
from relume_server.io import import_request, importer_zygote, sandbox

def reached(request):
    import socket, subprocess
    from pathlib import Path
    own, into = Path(request.file), Path(request.into)
    tries = {
        "read its file": own.read_bytes,
        "write its folder": lambda: (into / "it").write_text("x"),
        "read another file": (own.parent / "other").read_bytes,
        "list a folder": lambda: os.listdir(own.parent),
        "write another file": lambda: (own.parent / "new").write_text("x"),
        "make a link": lambda: (into / "link").symlink_to(own.parent / "other"),
        "read another process": lambda: Path(f"/proc/{os.getppid()}/environ").read_bytes(),
        "signal another process": lambda: os.kill(os.getppid(), 0),
        "speak to the network": lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM),
        "speak to the machine": lambda: socket.socket(socket.AF_UNIX),
        "run a program": lambda: subprocess.run(["/bin/true"]),
    }
    done = [name for name, attempt in tries.items() if not refused(attempt)]
    return {"id": ", ".join(done)}

def refused(attempt):
    try:
        attempt()
    except PermissionError:
        return True
    return False

def answer_of(request):
    name = request.name
    if name == "damage":
        os.kill(os.getpid(), signal.SIGSEGV)
    if name == "hang":
        time.sleep(600)
    if name == "turn":
        while True:
            pass
    if name == "swell":
        bytearray(request.max_bytes)
    if name == "write":
        import numpy
        numpy.save(os.path.join(request.into, "texels.npy"), numpy.zeros(1 << 20))
    if name == "reach":
        return reached(request)
    if name == "environment":
        return {"id": " ".join(os.environ)}
    if name == "defect":
        raise ValueError("of nobody's file")
    return {"id": f"{os.getpid()} {os.getppid()}"} if name == "it" else {name: "no."}

import_request._import = lambda request: answer_of(request)["id"]
importer_zygote._load = lambda: (importlib.import_module("numba.core.caching"), sandbox.missing_features())
def answer(request):
    return import_request.run_import(request) if request.name == "write" else answer_of(request)

importer_zygote.run_import = answer
importer_zygote.main()
"""


def asked(name: str, seconds: int = 60) -> ImportRequest:
    return ImportRequest(tempfile.gettempdir(), "scene", "", None, name, seconds, 1 << 32, 1 << 32)


@pytest.fixture
def waiting(monkeypatch: pytest.MonkeyPatch) -> Iterator[Importers]:
    monkeypatch.setattr(import_processes, "_COMMAND", [sys.executable, "-c", STAND_IN])
    with closing(Importers()) as importers:
        yield importers


def parent_of(waiting: Importers) -> int:
    assert waiting._parent is not None
    return waiting._parent[0].pid


def test_each_file_has_its_own_process_of_one_parent(waiting: Importers) -> None:
    waiting.start()
    parent = parent_of(waiting)
    first, second = (waiting.run(asked("it")).split()[0] for _ in range(2))
    assert len({first, second, str(parent), str(os.getpid())}) == 4
    assert parent_of(waiting) == parent
    assert resident_bytes(int(first)) == resident_bytes(int(second)) == 0


def test_concurrent_files_do_not_wait_for_each_other(waiting: Importers) -> None:
    with ThreadPoolExecutor(1) as thread:
        hanging = thread.submit(waiting.run, asked("hang", 1))
        waiting.run(asked("it"))
        assert not hanging.done()
        assert isinstance(hanging.exception(), SceneError)


def test_dead_parent_is_replaced(waiting: Importers) -> None:
    waiting.start()
    parent = parent_of(waiting)
    os.kill(parent, signal.SIGKILL)
    os.waitid(os.P_PID, parent, os.WEXITED | os.WNOWAIT)
    assert waiting.run(asked("it"))
    assert parent_of(waiting) != parent


def test_close_ends_all_processes(waiting: Importers) -> None:
    waiting.start()
    parent = parent_of(waiting)
    waiting.close()
    assert resident_bytes(parent) == 0


def test_parent_ends_with_the_server(waiting: Importers) -> None:
    waiting.run(asked("it"))
    assert waiting._parent is not None
    process, asking = waiting._parent
    asking.close()
    assert process.wait(60) == 0


def test_import_process_ends_with_its_caller(waiting: Importers) -> None:
    asker, theirs = socket.socketpair()
    with theirs, waiting._lock:
        socket.send_fds(waiting._ensure_running(), [b"."], [theirs.fileno()])
    with asker:
        asker.sendall(json.dumps(asdict(asked("hang"))).encode() + b"\n")
        asker.shutdown(socket.SHUT_WR)
        assert json.loads(asker.recv(1 << 16))["code"] == -signal.SIGKILL


@pytest.mark.slow
def test_forked_parent_has_one_thread(tmp_path: Path) -> None:
    with closing(Importers()) as importers:
        with pytest.raises(SceneError, match="cannot be read"):
            importers.run(replace(asked("it"), file=str(tmp_path / "none")))
        assert len(list(Path(f"/proc/{parent_of(importers)}/task").iterdir())) == 1


@pytest.mark.parametrize(
    ("name", "seconds", "kind", "said"),
    [
        ("problem", 60, SceneError, "^no"),
        ("full", 60, DiskFullError, "free some space"),
        ("material", 60, MaterialError, "^no"),
        ("large", 60, ImportTooLargeError, "too large"),
        ("failure", 60, RelumeError, "^no"),
        ("damage", 60, SceneError, "damaged"),
        ("hang", 1, SceneError, "more than 1 s or"),
        ("turn", 1, SceneError, "more than 1 s or"),
        ("swell", 60, SceneError, "or 4.3 GB"),
    ],
)
def test_failed_import_reports_its_reason(
    waiting: Importers, name: str, seconds: int, kind: type[Exception], said: str
) -> None:
    with pytest.raises(kind, match=said) as failure:
        waiting.run(asked(name, seconds))
    assert type(failure.value) is kind


def test_defect_is_not_blamed_on_the_file_and_logs_one_line(
    waiting: Importers, caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(RelumeError, match="not because of the file") as failure:
        waiting.run(asked("defect"))
    assert make_problem(failure.value).status == 500
    (line,) = [record.getMessage() for record in caplog.records if record.levelno == logging.ERROR]
    assert "ValueError: of nobody's file" in line
    assert "\n" not in line


@pytest.mark.skipif(bool(missing_features()), reason=f"this machine has no {' and no '.join(missing_features())}")
def test_import_process_can_access_only_its_files(waiting: Importers, tmp_path: Path) -> None:
    for name in ("file", "other"):
        (tmp_path / name).write_text(name)
    into = tmp_path / "made"
    into.mkdir()
    done = waiting.run(replace(asked("reach"), file=str(tmp_path / "file"), into=str(into)))
    assert done == "read its file, write its folder"


def test_import_process_gets_no_password(waiting: Importers, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("RELUME_DATABASE", "AWS_SECRET_ACCESS_KEY", "OTEL_EXPORTER_OTLP_HEADERS", "ANYTHING"):
        monkeypatch.setenv(name, "secret")
    names = waiting.run(asked("environment")).split()
    assert "PATH" in names
    assert not {"RELUME_DATABASE", "AWS_SECRET_ACCESS_KEY", "OTEL_EXPORTER_OTLP_HEADERS", "ANYTHING"} & {*names}


def test_unpacking_stops_at_its_limit(waiting: Importers, tmp_path: Path) -> None:
    with pytest.raises(ImportTooLargeError):
        waiting.run(replace(asked("write"), into=str(tmp_path), max_file_bytes=1 << 18))
    assert (tmp_path / "texels.npy").stat().st_size <= 1 << 18


def test_missing_sandbox_is_logged_once(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr(import_processes, "_COMMAND", [sys.executable, "-c", STAND_IN])
    monkeypatch.setattr(import_processes, "missing_features", lambda: ("Landlock",))
    with closing(Importers()) as importers:
        importers.start()
        importers.start()
    assert len([line for line in caplog.messages if "this machine has no Landlock" in line]) == 1
