"""Database failures are readable messages, and retry loops log them once."""

import logging
import sys
import time
from pathlib import Path

import pytest
from fake_method import tiny_scene
from sqlalchemy import event
from sqlalchemy.exc import OperationalError

from relume.core.errors import DatabaseDamagedError, DiskFullError, ParameterError
from relume_worker.database import open_database
from relume_worker.database.failures import DatabaseError, Outage
from relume_worker.ledger import Ledger
from relume_worker.scenes import register_scene

GARBAGE = bytes(range(256)) * 64


def test_damaged_database_is_rejected_on_open(tmp_path: Path) -> None:
    (tmp_path / "relume.db").write_bytes(GARBAGE)
    with pytest.raises(DatabaseDamagedError, match=r"move relume.db, .* away"):
        open_database(f"sqlite:///{tmp_path / 'relume.db'}")
    assert (tmp_path / "relume.db").read_bytes() == GARBAGE


def test_postgresql_without_its_driver_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "relume_worker.database.postgresql", raising=False)
    monkeypatch.delattr("relume_worker.database.postgresql", raising=False)
    monkeypatch.setitem(sys.modules, "pg8000", None)
    with pytest.raises(ParameterError, match=r"pip install relume\[postgres\]"):
        open_database("postgresql://ann@db.example.org/relume")


def test_damage_while_open_is_reported(tmp_path: Path) -> None:
    engine = open_database(f"sqlite:///{tmp_path / 'relume.db'}")
    ledger = Ledger(engine)
    assert ledger.bakes() == []
    engine.dispose()  # drop cached pages
    for file in tmp_path.glob("relume.db*"):
        file.write_bytes(GARBAGE)
    with pytest.raises(DatabaseDamagedError):
        ledger.bakes()


def test_full_database_reports_it_and_recovers(tmp_path: Path) -> None:
    engine = open_database(f"sqlite:///{tmp_path / 'relume.db'}")
    is_full = [True]

    @event.listens_for(engine, "checkout")
    def bound(connection, *_: object) -> None:  # type: ignore[no-untyped-def]
        pages = connection.execute("PRAGMA page_count").fetchone()[0] if is_full[0] else 1 << 20
        connection.execute(f"PRAGMA max_page_count = {pages}")

    scene, ledger = tiny_scene(), Ledger(engine)
    with pytest.raises(DiskFullError, match="free some space"), engine.begin() as connection:
        connection.exec_driver_sql("CREATE TABLE large AS SELECT randomblob(1000000)")
    is_full[0] = False
    register_scene(tmp_path, ledger, scene)


def test_calls_that_overlap_a_state_change_are_ignored(caplog: pytest.LogCaptureFixture) -> None:
    outage, away = Outage(logging.getLogger("outage"), "it"), Exception("away")
    with caplog.at_level(logging.WARNING, "outage"):
        slow = time.monotonic()
        outage.report_failure(away, time.monotonic())
        outage.report_failure(away, time.monotonic())
        outage.report_recovered(slow)  # answered before the outage
        late = time.monotonic()
        outage.report_recovered(time.monotonic())
        outage.report_failure(away, late)  # failed before the recovery
        outage.report_failure(away, time.monotonic())
    assert [record.getMessage() for record in caplog.records] == [
        "it does not answer (away); trying again",
        "it answers again",
        "it does not answer (away); trying again",
    ]


def test_loop_logs_each_error_and_its_end_once(caplog: pytest.LogCaptureFixture) -> None:
    error = DatabaseError(logging.getLogger("loop"), "it cannot be read")
    with caplog.at_level(logging.WARNING, "loop"):
        for _ in range(3):
            error.report_failure(OperationalError("SELECT 1", {}, Exception("away")))
        error.report_failure(DiskFullError("the database"))
        for _ in range(2):
            error.report_recovered()
        error.report_failure(ZeroDivisionError("nobody foresaw it"))
    assert [record.getMessage().split(" (")[0] for record in caplog.records] == [
        "it cannot be read",
        "it cannot be read",
        "it cannot be read: resolved",
        "it cannot be read",
    ]
    assert [bool(record.exc_info) for record in caplog.records] == [False, False, False, True]
    assert "\n" not in caplog.records[0].getMessage()
