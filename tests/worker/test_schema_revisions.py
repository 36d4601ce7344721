"""Databases of every version are upgraded once to the current schema; newer ones are rejected."""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Engine, inspect, select, text
from sqlalchemy.exc import IntegrityError, SQLAlchemyError

from relume.core.errors import LedgerVersionError, ParameterError
from relume.store.bake_protocol import Task
from relume_server.auth.tables import AuditRow, OwnedRow, TokenRow
from relume_server.persistence.look_store import LookStore
from relume_server.persistence.share_store import ShareStore
from relume_server.persistence.tables import (
    CommentRow,
    LookRow,
    RoomRow,
    ShareRow,
)
from relume_worker import lease
from relume_worker.cameras import list_cameras
from relume_worker.database import open_database, upgrading
from relume_worker.database.connect import connect
from relume_worker.database.models import Base, JobRow
from relume_worker.database.upgrading import draft_revision, get_revision, latest_revision, upgrade
from relume_worker.lease import new_owner
from relume_worker.ledger import Ledger
from relume_worker.scenes import list_scenes
from relume_worker.status import TaskCost

BEFORE = Path(__file__).with_name("before_revisions.sql").read_text(encoding="utf-8")
TABLES = (LookRow, ShareRow, CommentRow, RoomRow, TokenRow, OwnedRow, AuditRow)
JOB_TABLES = ("bakes", "renders", "truths", "btfs")


@pytest.fixture
def old_ledger(tmp_path: Path) -> Path:
    """A ledger that relume 0.1 created before revisions, with rows in every table."""
    path = tmp_path / "old.db"
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(BEFORE)
    return path


def differences(engine: Engine) -> object:
    """Differences between the tables in the code and in a database."""
    with engine.connect() as connection:
        return compare_metadata(MigrationContext.configure(connection), Base.metadata)


def revision(engine: Engine) -> str | None:
    with engine.connect() as connection:
        return get_revision(connection)


def rows(engine: Engine) -> dict[str, list[Any]]:
    """All rows of a database."""
    with engine.connect() as connection:
        tables = sorted(set(inspect(connection).get_table_names()) - {"alembic_version"})
        return {table: list(connection.execute(text(f"SELECT * FROM {table}")).all()) for table in tables}


def pairs(now: dict[str, list[Any]], before: dict[str, list[Any]]) -> list[tuple[Any, Any]]:
    """Rows after and before; added columns come last, and new tables are empty. Jobs are in one table now."""
    before = {table: rows for table, rows in before.items() if table not in JOB_TABLES}
    now = {table: rows for table, rows in now.items() if table != "jobs"}
    expected = {table: len(before.get(table, [])) for table in now}
    assert {table: len(rows) for table, rows in now.items()} == expected
    assert before.keys() <= now.keys()
    return [(row, old_ledger) for table in before for row, old_ledger in zip(now[table], before[table], strict=True)]


def test_revisions_produce_the_tables_of_the_code(ledger_url: str) -> None:
    with closing(Ledger(engine := open_database(ledger_url))):
        assert differences(engine) == []
        assert revision(engine) == latest_revision()


def test_ledger_from_before_revisions_is_upgraded_with_its_rows(old_ledger: Path) -> None:
    before = connect(f"sqlite:///{old_ledger}")
    assert revision(before) is None
    old_rows, old_columns = rows(before), [column["name"] for column in inspect(before).get_columns("bakes")]
    before.dispose()
    with closing(Ledger(engine := open_database(f"sqlite:///{old_ledger}"))) as ledger:
        assert (revision(engine), differences(engine)) == (latest_revision(), [])
        assert all(old_rows.values())
        now = rows(engine)
        assert [row[: len(old_ledger)] for row, old_ledger in pairs(now, old_rows)] == [
            old_ledger for _, old_ledger in pairs(now, old_rows)
        ]
        (scene,), (bake,) = list_scenes(ledger), ledger.bakes()
        assert (bake.scene, bake.state, len(ledger.finished_tasks(bake.id))) == (scene.id, "ready", 20)
        assert [camera.name for camera in list_cameras(ledger, scene.id)] == ["kept"]
        assert LookStore(ledger.sessions).get("red").document == '{"materials":{}}'
        assert ShareStore(ledger.sessions).get("0123456789").document == {"bake": "x"}
        with ledger.sessions() as session:
            states = {job.kind: job.state for job in session.scalars(select(JobRow))}
        assert states == {"bake": "ready", "render": "ready", "btf": "failed", "comparison": "queued"}
        values = dict(zip(old_columns, old_rows["bakes"][0], strict=True))
        row = {"request": values.pop("recipe"), "kind": "bake", **values}
        with engine.connect() as connection:
            (job,) = connection.execute(text("SELECT * FROM jobs WHERE kind = 'bake'")).mappings()
        assert {name: job[name] for name in row} == row


PLAN = {"num_view_samples": 1, "num_rays": 10**9, "store_bytes": 1, "peak_bytes": 1}
RECIPE = {"method": "fake", "views": ["front"], "size": [8, 8], "num_lights": 3, "relightable": False}


def test_upgrade_keeps_waiting_and_running_bakes(ledger_url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plans = {"large": PLAN, "small": {**PLAN, "work_s": 1.0}, "running": PLAN, "stopped": PLAN}
    states = {"running": "running", "stopped": "canceled"}
    with (before := connect(ledger_url)).begin() as connection:
        config = upgrading._config()
        config.attributes["connection"] = connection
        command.upgrade(config, "0011")
        connection.execute(text("INSERT INTO scenes VALUES ('s', 'triangle', 0, '{}')"))
        for number, (name, plan) in enumerate(plans.items()):
            values = {
                "id": name, "scene_id": "s", "recipe": json.dumps(RECIPE), "plan": json.dumps(plan), "client": "Ann",
                "state": states.get(name, "queued"), "created": 9.0 - number, "queued": float(number), "progress": 0.5,
                "bytes": 0, "run": "r", "heartbeat": time.time(), "owner": None,
            }  # fmt: skip
            if name == "running":
                values["owner"] = "elsewhere/1/nonce/0"
            columns = ", ".join(f'"{column}"' for column in values)
            parameters = ", ".join(f":{column}" for column in values)
            connection.execute(text(f"INSERT INTO bakes ({columns}) VALUES ({parameters})"), values)
        connection.execute(text("INSERT INTO tasks VALUES ('running', 0, 1, 1, 5, 0.1, 0.2)"))
    before.dispose()
    with closing(Ledger(engine := open_database(ledger_url))) as ledger:
        assert (revision(engine), differences(engine)) == (latest_revision(), [])
        assert {bake.id: bake.state for bake in ledger.bakes("s")} == {"large": "queued", "small": "queued", **states}
        waiting = [(work.id, work.is_first, work.created, work.num_elsewhere) for work in ledger.claimable(["bake"])]
        assert sorted(waiting) == [("large", False, 0.0, 1), ("small", True, 1.0, 0)]
        assert ledger.get("bake", "running").run == "r"
        ledger.owner = "elsewhere/1/nonce/0"  # it was upgraded while it ran
        assert ledger.finish_task("running", Task(0, 2, "left", 8, 16), TaskCost(5, 0.1, 0.2), 1)
        assert ledger.finished_tasks("running").keys() == {(0, 1), (0, 2)}
        ledger.owner = new_owner()
        monkeypatch.setattr(lease, "LEASE_S", -1.0)
        assert ledger.claim("running")
        with pytest.raises(IntegrityError), engine.begin() as connection:
            connection.execute(text("DELETE FROM scenes"))
        with pytest.raises(IntegrityError), engine.begin() as connection:
            connection.execute(text("DELETE FROM jobs WHERE id = 'running'"))
        ledger.delete(list(plans))
        assert ledger.bakes() == []


def test_older_ledgers_get_missing_columns_and_tables(old_ledger: Path) -> None:
    with sqlite3.connect(old_ledger) as connection:
        for column in ("phase", "phase_since", "crowding"):
            connection.execute(f"ALTER TABLE bakes DROP COLUMN {column}")
        connection.execute("DROP TABLE shares")  # the state if only the command line was used
    with ThreadPoolExecutor(4) as threads:  # a server and the command line may start at once
        engines = list(threads.map(open_database, [f"sqlite:///{old_ledger}"] * 4))
    assert differences(engines[0]) == []
    assert Ledger(engines[0]).bakes()[0].phase is None
    for engine in engines:
        engine.dispose()


def test_values_get_their_new_names(old_ledger: Path) -> None:
    with (before := connect(f"sqlite:///{old_ledger}")).begin() as connection:
        config = upgrading._config()
        config.attributes["connection"] = connection
        command.upgrade(config, "0009")
        connection.execute(text("UPDATE bakes SET state = 'cancelled'"))
        connection.execute(text("INSERT INTO owned VALUES ('btf-work', 'a', 'Ann', 7), ('btf', 'b', 'Ann', 8)"))
    before.dispose()
    with closing(Ledger(open_database(f"sqlite:///{old_ledger}"))) as ledger:
        assert [bake.state for bake in ledger.bakes()] == ["canceled"]
        with ledger.sessions() as session:
            assert set(session.scalars(select(OwnedRow.kind))) == {"btf-job", "btf"}


def test_concurrent_processes_create_the_tables_once(ledger_url: str) -> None:
    with ThreadPoolExecutor(4) as threads:
        engines = list(threads.map(open_database, [ledger_url] * 4))
    assert {revision(engine) for engine in engines} == {latest_revision()}
    for engine in engines:
        engine.dispose()


def test_ledger_of_a_newer_version_is_rejected_unchanged(ledger_url: str) -> None:
    engine = open_database(ledger_url)
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(LedgerVersionError, match="upgraded by a newer relume"):
        open_database(ledger_url)
    with pytest.raises(LedgerVersionError, match="restore a backup"):
        upgrade(engine, is_requested=True)
    assert revision(engine) == "9999"
    engine.dispose()


REVISION = '''"""{doc}."""
import sqlalchemy as sa
from alembic import op
revision, down_revision, is_additive = "{name}", "{before}", {is_additive}

def upgrade() -> None:
    {step}
'''


@pytest.fixture
def new_revision(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    """Write a revision after the newest one, in a copy of the revision folder."""
    folder = tmp_path / "revisions"
    (folder / "versions").mkdir(parents=True)
    for file in upgrading.REVISIONS.rglob("*.*"):
        if "__pycache__" not in file.parts:
            (folder / file.relative_to(upgrading.REVISIONS)).write_text(file.read_text())
    monkeypatch.setattr(upgrading, "REVISIONS", folder)

    def write(step: str, is_additive: bool) -> None:
        before, name = latest_revision(), f"{int(latest_revision()) + 1:04d}"
        source = REVISION.format(doc="Tests", name=name, before=before, is_additive=is_additive, step=step)
        (folder / "versions" / f"{name}_tests.py").write_text(source)
        upgrading._scripts.cache_clear()

    yield SimpleNamespace(write=write, folder=folder)
    upgrading._scripts.cache_clear()


def test_additive_revisions_run_at_start_and_others_on_request(ledger_url: str, new_revision: SimpleNamespace) -> None:
    open_database(ledger_url).dispose()
    new_revision.write('op.add_column("looks", sa.Column("note", sa.Text()))', True)
    open_database(ledger_url).dispose()
    new_revision.write('op.drop_column("looks", "note")', False)
    with pytest.raises(LedgerVersionError, match="run: relume backup FOLDER, then: relume db upgrade"):
        open_database(ledger_url)
    engine = connect(ledger_url)
    assert "note" in {column["name"] for column in inspect(engine).get_columns("looks")}
    assert [name for _, name in upgrade(engine, is_requested=True)] == ["Tests"]
    assert upgrade(engine, is_requested=True) == []
    engine.dispose()
    open_database(ledger_url).dispose()


def test_failed_revision_changes_nothing(ledger_url: str, new_revision: SimpleNamespace) -> None:
    open_database(ledger_url).dispose()
    new_revision.write('op.add_column("looks", sa.Column("note", sa.Text())); raise ZeroDivisionError', True)
    with pytest.raises(ZeroDivisionError):
        open_database(ledger_url)
    engine = connect(ledger_url)
    assert "note" not in {column["name"] for column in inspect(engine).get_columns("looks")}
    assert revision(engine) == f"{int(latest_revision()) - 1:04d}"
    engine.dispose()


def test_drafted_revision_contains_the_missing_tables_and_columns(
    old_ledger: Path, new_revision: SimpleNamespace
) -> None:
    with closing(Ledger(engine := open_database(f"sqlite:///{old_ledger}"))):
        with engine.begin() as connection:
            connection.execute(text("DROP TABLE shares"))
        with engine.begin() as connection:
            path = draft_revision(connection, Base.metadata, "links of looks")
    assert path.parent == new_revision.folder / "versions"
    assert path.name == f"{int(latest_revision()) + 1:04d}_links_of_looks.py"
    assert "op.create_table('shares'" in path.read_text()


@pytest.mark.parametrize(
    "url",
    [
        "mysql://root@host/name",
        "nonsense",
        "oracle://secret@host",
        "postgresql://host/secret",
        "postgresql://me:secret@host/name?sslmode=secret",
        "postgresql://me@host/name?sslmode=require&options=secret",
    ],
)
def test_unsupported_databases_are_rejected_with_a_reason(url: str) -> None:
    with pytest.raises(ParameterError, match=r"postgresql://user:password@host/name|sslmode=prefer") as refusal:
        open_database(url)
    assert "secret" not in str(refusal.value)


@pytest.mark.parametrize("ledger_url", ["postgresql"], indirect=True)
@pytest.mark.parametrize("mode", ["require", "verify-full"])
def test_server_without_tls_is_rejected_if_tls_is_required(ledger_url: str, mode: str) -> None:
    with pytest.raises(SQLAlchemyError, match="refuses SSL"):
        open_database(f"{ledger_url}?sslmode={mode}")
    open_database(f"{ledger_url}?sslmode=prefer").dispose()
