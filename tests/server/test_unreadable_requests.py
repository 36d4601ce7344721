"""Rows of jobs whose request another version of relume wrote, or that are damaged, break neither lists nor starts."""

import time
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from server_fakes import Control, InThreadBatches
from server_fixtures import open_fake_bakes

from relume_server.app import create_app
from relume_server.batch.btf_steps import RESULT_FILE
from relume_server.batch.reference_passes import FIGURES
from relume_server.persistence.tables import BtfRow, ComparisonRow, JobRow, RenderRow
from relume_server.settings import Settings
from relume_worker.database import open_database
from relume_worker.ledger import Ledger

WAIT_S = 60.0
UNREADABLE = "the request cannot be read, because another version of relume wrote it or it is damaged; request it again"
READABLE = {
    RenderRow: '{"bake":"0123456789abcdef","view":"front","looks":[{}],"format":"png"}',
    ComparisonRow: '{"bake":"0123456789abcdef","view":"front"}',
    BtfRow: '{"name":"Felt","error":0.05}',
}
UNREADABLE_REQUESTS = {
    "a": '{"bake":"0123456789abcdef","view":"front","looks":[{}],"format":"png","name":"Felt","error":0.05,"eye":1}',
    "b": "{}",
    "c": '{"bake":"012',
    "d": "",
}
STATES = ("queued", "running", "ready", "failed", "stopped")
URLS = {RenderRow: "/api/renders", ComparisonRow: "/api/comparisons", BtfRow: "/api/materials/btf/jobs"}


@pytest.fixture(params=URLS, ids=lambda row: row.__tablename__)
def row_type(request: pytest.FixtureRequest, settings: Settings) -> type[JobRow]:
    """A kind of jobs, with unreadable rows in every state, and one readable row."""
    row: type[JobRow] = request.param
    ledger = Ledger(open_database(settings.database_url))
    with ledger.sessions.begin() as session:
        session.add(row(id="f" * 16, request=READABLE[row], state="ready", done=1, created=time.time()))
        for letter, text in UNREADABLE_REQUESTS.items():
            for digit, state in enumerate(STATES):
                identity = letter * 15 + str(digit)
                session.add(row(id=identity, request=text, state=state, done=1, created=time.time(), client="Ann"))
    ledger.close()
    return row


@pytest.fixture
def restarted(row_type: type[JobRow], settings: Settings, control: Control) -> Iterator[TestClient]:
    """A server that starts with these rows."""
    app = create_app(
        settings, open_library=control.open_library, open_batches=InThreadBatches, open_bakes=open_fake_bakes
    )
    with TestClient(app, raise_server_exceptions=False) as client:
        yield client


def states(client: TestClient) -> set[str]:
    sessions = client.app.state.services.bakes.ledger.sessions  # type: ignore[attr-defined]
    with sessions() as session:
        return {row.state for row_type in URLS for row in session.query(row_type)}


def test_unreadable_requests_are_listed_as_failed(restarted: TestClient, row_type: type[JobRow]) -> None:
    url, delete_files = URLS[row_type], "" if row_type is RenderRow else "?delete_files=true"
    answer = restarted.get(url, params={"limit": 100})
    assert answer.status_code == 200, answer.text
    jobs: dict[str, Any] = {job["id"]: job for job in answer.json()}
    assert len(jobs) == 1 + len(UNREADABLE_REQUESTS) * len(STATES)
    assert jobs.pop("f" * 16)["state"] == "ready"
    assert {(job["state"], job["problem"], job["user"]) for job in jobs.values()} == {("failed", UNREADABLE, "Ann")}
    for identity in jobs:
        assert restarted.get(f"{url}/{identity}").json()["problem"] == UNREADABLE
        resumed = restarted.post(f"{url}/{identity}/resume")
        assert (resumed.status_code, resumed.json()["detail"]) == (409, UNREADABLE)
        assert restarted.delete(f"{url}/{identity}{delete_files}").status_code == 204
    assert [job["id"] for job in restarted.get(url).json()] == ["f" * 16]


def test_unreadable_requests_that_are_queued_fail_in_the_database(restarted: TestClient) -> None:
    deadline = time.monotonic() + WAIT_S
    while states(restarted) & {"queued", "running"}:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert states(restarted) == {"ready", "failed", "stopped"}


@pytest.mark.parametrize("text", ['{"missing":[],"error":1}', '{"material":', "[]", ""])
def test_unreadable_results_of_ready_jobs_are_omitted(
    row_type: type[JobRow], settings: Settings, restarted: TestClient, text: str
) -> None:
    for path in (f"comparisons/{'f' * 16}/{FIGURES}", f"btf-jobs/{'f' * 16}/{RESULT_FILE}"):
        (settings.data / path).parent.mkdir(parents=True)
        (settings.data / path).write_text(text)
    body = restarted.get(f"{URLS[row_type]}/{'f' * 16}").json()
    assert (body["state"], body.get("material"), body.get("error_all_paths")) == ("ready", None, None)
    assert restarted.get(URLS[row_type]).status_code == 200
