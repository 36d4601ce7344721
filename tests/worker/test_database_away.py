"""A PostgreSQL that is away for some seconds: one line, a clear answer, and all goes on."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from fake_method import RECIPE, FakeMethod, tiny_scene
from postgres import Cluster
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError, OperationalError

from server.errors import problem_of
from worker.database import open_database
from worker.database.faults import is_away
from worker.ledger import Ledger
from worker.scenes import register_scene
from worker.service import BakeService


@pytest.fixture
def own_cluster() -> Iterator[Cluster]:
    """One that no other test uses: it is stopped."""
    cluster = Cluster()
    yield cluster
    cluster.remove()


def test_a_bake_outlives_a_database_that_is_away(
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
            own_cluster.stop()
            with pytest.raises(OperationalError) as failure:
                service.bakes()
            assert is_away(failure.value)
            assert problem_of(failure.value).status == 503
            assert "try again in a while" in str(problem_of(failure.value).detail)
            time.sleep(1.5)  # every loop has met it
            own_cluster.start()
            assert list(changes)[-1].state == "ready"
        assert [status.state for status in service.bakes()] == ["ready"]
    assert len(log.read_text().split()) == len(set(log.read_text().split()))  # no task was done twice
    said = [record.getMessage().split(" (")[0] for record in caplog.records if record.name.startswith("worker")]
    assert said == ["the database does not answer", "the database does not answer: that is over"]


def test_failures_of_statements_are_no_absence(ledger_url: str) -> None:
    with closing(Ledger(engine := open_database(ledger_url))), engine.connect() as connection:
        with pytest.raises(DBAPIError) as failure:
            connection.execute(text("SELECT nothing FROM nowhere"))
        assert not is_away(failure.value)
