"""A PostgreSQL outage of some seconds: one log line, clear errors, and recovery."""

from __future__ import annotations

import logging
import socket
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from fake_method import RECIPE, FakeMethod, tiny_scene
from postgres import Cluster
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError, IntegrityError, OperationalError

from relume_server.errors import make_problem
from relume_worker.database import open_database, postgresql
from relume_worker.database.failures import describe_error, is_unavailable
from relume_worker.ledger import Ledger
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService


@pytest.fixture
def own_cluster() -> Iterator[Cluster]:
    """A cluster for one test: it is stopped."""
    cluster = Cluster()
    yield cluster
    cluster.remove()


def test_bake_survives_a_database_outage(
    tmp_path: Path, own_cluster: Cluster, caplog: pytest.LogCaptureFixture
) -> None:
    log = tmp_path / "log"
    methods = {"fake": FakeMethod(delay_s=0.05, log=str(log))}
    service = BakeService(tmp_path / "data", own_cluster.new_database(), methods=methods)
    register_scene(service.data_dir, service.ledger, tiny_scene())
    with caplog.at_level(logging.WARNING), service:
        with service.subscribe(service.submit(tiny_scene().id, RECIPE)) as changes:
            while (status := changes.get(60)) is not None and not 0.2 < status.progress < 1:
                pass
            caplog.clear()  # the end of another test's outage
            own_cluster.stop()
            with pytest.raises(OperationalError) as failure:
                service.bakes()
            assert is_unavailable(failure.value)
            assert make_problem(failure.value).status == 503
            assert "try again later" in str(make_problem(failure.value).detail)
            time.sleep(1.5)  # every loop has failed once
            own_cluster.start()
            assert list(changes)[-1].state == "ready"
        assert [status.state for status in service.bakes()] == ["ready"]
    assert len(log.read_text().split()) == len(set(log.read_text().split()))  # no task ran twice
    said = [record.getMessage().split(" (")[0] for record in caplog.records if record.name.startswith("relume_worker")]
    assert said == ["the database does not answer", "the database answers again"]


def test_statement_errors_are_not_an_outage(ledger_url: str) -> None:
    with closing(Ledger(engine := open_database(ledger_url))), engine.connect() as connection:
        with pytest.raises(DBAPIError) as failure:
            connection.execute(text("SELECT nothing FROM nowhere"))
        assert not is_unavailable(failure.value)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(postgresql, "TIMEOUT_S", 0.3)


@pytest.mark.usefixtures("impatient")
def test_server_that_accepts_and_stays_silent_is_unavailable() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute, pytest.raises(OperationalError, match="timed out") as failure:
        open_database(f"postgresql://relume@127.0.0.1:{mute.getsockname()[1]}/relume")
    assert is_unavailable(failure.value)


@pytest.mark.usefixtures("impatient")
def test_server_that_stops_responding_is_unavailable_and_reconnected(own_cluster: Cluster) -> None:
    with closing(Ledger(engine := open_database(own_cluster.new_database()))):
        with pytest.raises(OperationalError) as failure, engine.connect() as connection:
            connection.execute(text("SELECT pg_sleep(2)"))
        assert is_unavailable(failure.value)
        assert failure.value.connection_invalidated
        own_cluster.stop()
        own_cluster.start()  # pooled connections were closed
        with engine.connect() as connection:
            assert connection.scalar(text("SELECT 1")) == 1


def test_error_message_of_the_server_is_reported(own_cluster: Cluster) -> None:
    url = own_cluster.new_database()
    with pytest.raises(DBAPIError) as failure:
        open_database(f"{url}_of_nobody")
    assert describe_error(failure.value).endswith("does not exist")
    assert not is_unavailable(failure.value)


def test_rows_with_missing_references_are_rejected(ledger_url: str) -> None:
    ledger = Ledger(engine := open_database(ledger_url))
    with closing(ledger), pytest.raises(IntegrityError), engine.begin() as connection:
        connection.execute(text("INSERT INTO cameras VALUES ('nowhere', 'one', '{}')"))
