"""Processes that wait for imports: taken, replaced, ended; what they answer."""

import logging
import sys
from collections.abc import Iterator
from contextlib import closing

import pytest
from sqlalchemy.exc import OperationalError

from relume.errors import DatabaseDamagedError, DiskFullError, RelumeError, SceneError, StorageError
from relume.resident import resident_bytes
from server.errors import problem_of
from server.files import importers
from server.files.importers import Importers
from server.files.importing import ImportRequest

STAND_IN = """
import json, os, signal, sys, time
told = sys.stdin.read()
name = json.loads(told)["name"] if told else ""
if name == "damage":
    os.kill(os.getpid(), signal.SIGSEGV)
if name == "hang":
    time.sleep(600)
if name == "defect":
    raise ValueError("of nobody's file")
if name in ("problem", "full", "storage", "away", "damaged", "failure"):
    print(json.dumps({name: "no."}))
elif name:
    print(json.dumps({"id": str(os.getpid())}))
"""


def asked(name: str, seconds: int = 60) -> ImportRequest:
    return ImportRequest("", "", "scene", "", None, name, seconds, 1 << 30)


@pytest.fixture
def waiting(monkeypatch: pytest.MonkeyPatch) -> Iterator[Importers]:
    monkeypatch.setattr(importers, "_COMMAND", [sys.executable, "-c", STAND_IN])
    with closing(Importers(1)) as found:
        found.start()
        yield found


def test_who_waits_is_asked_and_another_waits_then(waiting: Importers) -> None:
    (first,) = waiting._waiting
    assert waiting.run(asked("it")) == str(first.pid)
    (second,) = waiting._waiting
    assert waiting.run(asked("it")) == str(second.pid) != str(first.pid)


def test_one_that_has_ended_is_not_asked(waiting: Importers) -> None:
    (first,) = waiting._waiting
    first.kill()
    first.wait()
    assert waiting.run(asked("it")) != str(first.pid)
    first.communicate()


def test_nobody_waits_when_it_is_closed(waiting: Importers) -> None:
    (first,) = waiting._waiting
    waiting.close()
    waiting.start()
    assert waiting._waiting == []
    assert resident_bytes(first.pid) == 0


def test_one_without_a_server_ends(waiting: Importers) -> None:
    (first,) = waiting._waiting
    first.communicate()
    assert first.returncode == 0
    waiting._waiting.clear()


@pytest.mark.parametrize(
    ("name", "seconds", "kind", "said"),
    [
        ("problem", 60, SceneError, "^no"),
        ("full", 60, DiskFullError, "free some space"),
        ("storage", 60, StorageError, "^no"),
        ("away", 60, OperationalError, "no"),
        ("damaged", 60, DatabaseDamagedError, "put a backup"),
        ("failure", 60, RelumeError, "^no"),
        ("damage", 60, SceneError, "damaged"),
        ("hang", 1, SceneError, "more than 1 s or"),
    ],
)
def test_what_it_answers_is_why_it_failed(
    waiting: Importers, name: str, seconds: int, kind: type[Exception], said: str
) -> None:
    (first,) = waiting._waiting
    with pytest.raises(kind, match=said) as failure:
        waiting.run(asked(name, seconds))
    assert type(failure.value) is kind
    assert resident_bytes(first.pid) == 0


def test_a_defect_is_no_fault_of_the_file_and_leaves_one_line(
    waiting: Importers, caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(RelumeError, match="not because of the file") as failure:
        waiting.run(asked("defect"))
    assert problem_of(failure.value).status == 500
    (line,) = [record.getMessage() for record in caplog.records if record.levelno == logging.ERROR]
    assert "ValueError: of nobody's file" in line
    assert "\n" not in line
