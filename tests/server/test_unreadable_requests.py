"""Rows of jobs whose request another version of relume wrote, or that are damaged, break neither lists nor starts."""

import time
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from server_fakes import Control, InThreadSteps
from server_fixtures import open_fake_bakes
from sqlalchemy import select

from relume_server.app import create_app
from relume_server.batch.btf_steps import RESULT_FILE
from relume_server.batch.reference_passes import FIGURES
from relume_server.settings import Settings
from relume_worker.database import open_database
from relume_worker.database.models import JobRow
from relume_worker.ledger import Ledger

WAIT_S = 60.0
UNREADABLE = "the request cannot be read, because another version of relume wrote it or it is damaged; request it again"
READABLE = {
    "render": '{"bake":"0123456789abcdef","view":"front","looks":[{}],"format":"png"}',
    "comparison": '{"bake":"0123456789abcdef","view":"front"}',
    "btf": '{"name":"Felt","error":0.05}',
    "bake": '{"method":"direct","views":["front"],"size":[8,8],"num_lights":3,"relightable":false}',
}
PLAN = '{"num_view_samples":1,"num_rays":1,"store_bytes":1,"peak_bytes":1}'
UNREADABLE_REQUESTS = {
    "a": '{"bake":"0123456789abcdef","view":"front","looks":[{}],"format":"png","name":"Felt","error":0.05,"eye":1}',
    "b": "{}",
    "c": '{"bake":"012',
    "d": "",
}
STATES = ("queued", "running", "ready", "failed", "canceled")
URLS = {
    "render": "/api/renders",
    "comparison": "/api/comparisons",
    "btf": "/api/materials/btf/jobs",
    "bake": "/api/bakes",
}


@pytest.fixture(params=URLS)
def kind(request: pytest.FixtureRequest, settings: Settings) -> str:
    """A kind of jobs, with unreadable rows in every state, and one readable row."""
    kind: str = request.param
    ledger = Ledger(open_database(settings.database_url))
    with ledger.sessions.begin() as session:
        common = {"kind": kind, "done": 1, "created": time.time(), "plan": PLAN if kind == "bake" else None}
        session.add(JobRow(id="f" * 16, request=READABLE[kind], state="ready", **common))
        for letter, text in UNREADABLE_REQUESTS.items():
            for digit, state in enumerate(STATES):
                identity = letter * 15 + str(digit)
                session.add(JobRow(id=identity, request=text, state=state, client="Ann", **common))
    ledger.close()
    return kind


@pytest.fixture
def restarted(kind: str, settings: Settings, control: Control) -> Iterator[TestClient]:
    """A server that starts with these rows."""
    app = create_app(settings, open_library=control.open_library, open_steps=InThreadSteps, open_bakes=open_fake_bakes)
    with TestClient(app, raise_server_exceptions=False) as client:
        yield client


def states(client: TestClient) -> set[str]:
    sessions = client.app.state.services.bakes.ledger.sessions  # type: ignore[attr-defined]
    with sessions() as session:
        return set(session.scalars(select(JobRow.state)))


def test_unreadable_requests_are_listed_as_failed(restarted: TestClient, kind: str) -> None:
    url, delete_files = URLS[kind], "" if kind == "render" else "?delete_files=true"
    answer = restarted.get(url, params={"limit": 100})
    assert answer.status_code == 200, answer.text
    jobs: dict[str, Any] = {job["id"]: job for job in answer.json()}
    assert len(jobs) == 1 + len(UNREADABLE_REQUESTS) * len(STATES)
    assert jobs.pop("f" * 16)["state"] == "ready"
    assert {(job["state"], job["problem"], job["user"]) for job in jobs.values()} == {("failed", UNREADABLE, "Ann")}
    for identity in jobs:
        assert restarted.get(f"{url}/{identity}").json()["problem"] == UNREADABLE
        if kind != "bake":  # a bake is resumed by its recipe
            resumed = restarted.post(f"{url}/{identity}/resume")
            assert (resumed.status_code, resumed.json()["detail"]) == (409, UNREADABLE)
        assert restarted.delete(f"{url}/{identity}{delete_files}").status_code == 204
    assert [job["id"] for job in restarted.get(url).json()] == ["f" * 16]


def test_unreadable_requests_that_are_queued_fail_in_the_database(restarted: TestClient) -> None:
    deadline = time.monotonic() + WAIT_S
    while states(restarted) & {"queued", "running"}:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert states(restarted) == {"ready", "failed", "canceled"}


@pytest.mark.parametrize("text", ['{"missing":[],"error":1}', '{"material":', "[]", ""])
def test_unreadable_results_of_ready_jobs_are_omitted(
    kind: str, settings: Settings, restarted: TestClient, text: str
) -> None:
    for path in (f"comparisons/{'f' * 16}/{FIGURES}", f"btf-jobs/{'f' * 16}/{RESULT_FILE}"):
        (settings.data / path).parent.mkdir(parents=True)
        (settings.data / path).write_text(text)
    body = restarted.get(f"{URLS[kind]}/{'f' * 16}").json()
    assert (body["state"], body.get("material"), body.get("error_all_paths")) == ("ready", None, None)
    assert restarted.get(URLS[kind]).status_code == 200
