"""A server that stalled past its lease does not change a job that another server has taken over."""

import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from sqlalchemy import update

from relume.core.errors import CancelledError, RelumeError
from relume_server.batch import step_registry
from relume_server.batch.btf_steps import RESULT_FILE, UPLOAD_FILE
from relume_server.errors import make_problem
from relume_server.jobs.btf_jobs import BtfJobs
from relume_server.schemas.btfs import BtfRequest
from relume_worker.database import open_database
from relume_worker.database.clock import epoch_s
from relume_worker.database.models import JobRow
from relume_worker.jobs.claim import claim
from relume_worker.jobs.job import Quota
from relume_worker.jobs.job_ledger import JobLedger
from relume_worker.jobs.job_service import JobService
from relume_worker.jobs.step import Step
from relume_worker.lease import new_owner
from relume_worker.ledger import Ledger

WAIT_S = 30.0
Outcome = Callable[[Path], Mapping[str, Any]]


def fails(folder: Path) -> Mapping[str, Any]:
    raise RelumeError("the process was killed")


def breaks(folder: Path) -> Mapping[str, Any]:
    raise FileNotFoundError(2, "No such file or directory", "making")


def notices(folder: Path) -> Mapping[str, Any]:
    raise CancelledError("stopped")


def finishes(folder: Path) -> Mapping[str, Any]:
    (folder / RESULT_FILE).write_text('{"material": "0123456789abcdef"}')
    return {"is_done": True}


class Server:
    """A queue whose only step blocks until the test releases it."""

    def __init__(self, ledger: Ledger, data: Path, outcome: Outcome) -> None:
        self.has_begun, self.may_go_on, self.has_ended = (threading.Event() for _ in range(3))
        self.is_wanted: Callable[[], bool] = lambda: False
        self.quotas: list[str] = []
        self._outcome = outcome
        rows = JobLedger(ledger.sessions, Quota(9, 9), new_owner())
        self.service = JobService(rows, {})
        self.service.use_steps(self._run, lambda: 1, lambda error: make_problem(error).detail)
        self.jobs = BtfJobs(
            self.service, data, lambda job, *_: self.quotas.append(f"kept {job}"),
            lambda job: self.quotas.append(f"failed {job}"),
        )  # fmt: skip

    def _run(self, step: Step, report: object, is_wanted: Callable[[], bool]) -> Mapping[str, Any]:
        self.is_wanted = is_wanted
        self.has_begun.set()
        assert self.may_go_on.wait(WAIT_S)
        return self._outcome(Path(step.values["folder"]))


@pytest.fixture
def ledger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Ledger]:
    monkeypatch.setattr("relume_worker.jobs.job_service.RENEW_S", 2 * WAIT_S)  # a stalled server renews no lease
    with closing(Ledger(open_database(f"sqlite:///{tmp_path / 'a.db'}"))) as opened:
        yield opened


@pytest.mark.parametrize("outcome", [fails, breaks, notices, finishes])
def test_files_quota_and_state_of_a_taken_over_job_remain(
    tmp_path: Path, ledger: Ledger, outcome: Outcome, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    first, second = Server(ledger, tmp_path, outcome), Server(ledger, tmp_path, finishes)
    request = BtfRequest(name="Felt", error=0.05)
    work = first.jobs.submit(request, prepare=lambda into: (into / UPLOAD_FILE).write_bytes(b"sent"))
    folder = tmp_path / "btf-jobs" / work
    first.service.start()
    assert first.has_begun.wait(WAIT_S)
    assert first.is_wanted()
    with ledger.sessions.begin() as session:
        session.execute(update(JobRow).values(heartbeat=epoch_s() - 60.0))
    second.service.start()
    assert second.has_begun.wait(WAIT_S)
    assert f"BTF {work} is taken over from" in caplog.text

    first.service.ledger._leased_until_s = 0.0  # the cached answer is outdated
    assert not first.is_wanted()
    first.may_go_on.set()
    first.service._closing.set()
    wait_until(lambda: not first.service._runs)
    assert f"BTF {work} was taken over by another process" in caplog.text
    assert (folder / UPLOAD_FILE).read_bytes() == b"sent"
    assert first.quotas == []
    job = second.jobs.get(work)
    assert (job.state, job.problem) == ("running", None)
    assert second.is_wanted()

    second.may_go_on.set()
    wait_until(lambda: second.jobs.get(work).state == "ready" and not (folder / UPLOAD_FILE).exists())
    assert second.quotas == [f"kept {work}"]
    for server in (first, second):
        server.service.close()


def wait_until(is_reached: Callable[[], bool]) -> None:
    asked = threading.Event()
    for _ in range(int(WAIT_S / 0.02)):
        if is_reached():
            return
        asked.wait(0.02)
    raise TimeoutError


def test_step_without_its_file_lock_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_worker.jobs.claim._CHECK_INTERVAL_S", 0.0)
    canceled: list[bool] = []

    def work(shop: Any, report: Any, is_canceled: Callable[[], bool]) -> Mapping[str, Any]:
        canceled.append(is_canceled())
        claim(tmp_path, "the second")
        canceled.append(is_canceled())
        return {}

    monkeypatch.setattr(step_registry, "STEPS", {"work": work})
    step = Step("work", claim=(str(tmp_path), "the first"))
    claim(tmp_path, "the first")
    step_registry.do_step(SimpleNamespace(), step, lambda share: None, lambda: False)
    assert canceled == [False, True]
    with pytest.raises(CancelledError):
        step_registry.do_step(SimpleNamespace(), step, lambda share: None, lambda: False)
    assert canceled == [False, True]
