"""Jobs: claimed, shared fairly among clients, spread over slots, taken over, stopped."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from pydantic import BaseModel
from sqlalchemy import select, update

from relume.core.errors import CancelledError, DiskFullError, RelumeError
from relume.store.disk_space import RESERVE_BYTES
from relume_worker.database import open_database
from relume_worker.database.models import JobRow
from relume_worker.jobs.fair_share import FairShare, Waiting
from relume_worker.jobs.fair_slots import FairSlots
from relume_worker.jobs.job import BusyError, Quota, QuotaError
from relume_worker.jobs.job_kind import JobKind
from relume_worker.jobs.job_ledger import JobLedger
from relume_worker.jobs.job_run import JobRun
from relume_worker.jobs.job_service import JobService
from relume_worker.jobs.step import IsNeeded, ProgressCallback, Step
from relume_worker.lease import new_owner
from relume_worker.ledger import Ledger


def wait_for(is_reached: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30
    while not is_reached():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def next_client(turns: FairShare, waiting: Sequence[Waiting]) -> Waiting:
    first = turns.sort(waiting)[0]
    turns.pick_next(first.client)
    return first


def test_clients_take_turns_and_small_jobs_go_first() -> None:
    turns = FairShare({})
    waiting = [
        Waiting("a1", "ann", False, 1.0),
        Waiting("a2", "ann", False, 2.0),
        Waiting("b1", "bob", False, 3.0),
    ]
    assert [next_client(turns, waiting).id for _ in range(4)] == ["a1", "b1", "a1", "b1"]
    waiting.append(Waiting("a3", "ann", True, 4.0))
    assert [next_client(turns, waiting).id for _ in range(2)] == ["a3", "a3"]
    del waiting[0], waiting[-1]
    waiting.append(Waiting("c1", "cem", False, 5.0))
    assert [next_client(turns, waiting).id for _ in range(6)] == ["b1", "c1", "b1", "c1", "a2", "b1"]


def test_priorities_order_the_jobs_of_one_client_only() -> None:
    turns = FairShare({})
    waiting = [
        Waiting("a1", "ann", False, 1.0),
        Waiting("a2", "ann", False, 2.0, priority=5),
        Waiting("a3", "ann", False, 3.0, priority=-5),
        Waiting("b1", "bob", False, 4.0, priority=-10),
    ]
    assert [work.id for work in turns.sort(waiting)] == ["a2", "b1", "a1", "a3"]


def test_client_who_returns_between_turns_keeps_its_share() -> None:
    turns = FairShare({})
    many, one = [Waiting(f"a{k}", "ann", False, k) for k in range(4)], Waiting("b", "bob", False, 9.0)
    order = ""
    for _ in range(6):
        order += next_client(turns, [*many, one]).client[0]
        order += next_client(turns, many if order[-1] == "b" else [*many, one]).client[0]
    assert 5 <= order.count("b") <= 7


def test_idle_machines_do_not_all_begin_with_the_same_client() -> None:
    clients = [f"a{k}" for k in range(4)] + ["b0", "b1"]
    running: list[str] = []
    for _ in range(4):  # a new machine each time
        waiting = [
            Waiting(each, each[0], False, k, sum(other[0] == each[0] for other in running))
            for k, each in enumerate(clients)
            if each not in running
        ]
        running.append(FairShare({}).sort(waiting)[0].id)
    assert running == ["a0", "b0", "a1", "b1"]


def test_weights_set_the_number_of_turns() -> None:
    turns = FairShare({"ann": 3.0})
    waiting = [Waiting("b", "bob", False, 1.0), Waiting("a", "ann", False, 2.0)]
    assert "".join(next_client(turns, waiting).id for _ in range(12)).count("a") == 9
    assert next_client(turns, [Waiting("b", "bob", False, 1.0), Waiting("c", "cem", False, 0.0)]).id == "c"


def test_places_limit_concurrent_steps_and_waiting_ends_when_not_needed() -> None:
    slots, num_running, peak = FairSlots(lambda: 2, {}), 0, 0
    lock = threading.Lock()

    def work(client: str) -> None:
        nonlocal num_running, peak
        with slots.take(Step("work", client=client), lambda: True):
            with lock:
                num_running += 1
                peak = max(peak, num_running)
            time.sleep(0.01)
            with lock:
                num_running -= 1

    threads = [threading.Thread(target=work, args=("ann",)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert peak == 2
    with (
        slots.take(Step("work"), lambda: True),
        slots.take(Step("work"), lambda: True),
        pytest.raises(CancelledError, match="before it started"),
        slots.take(Step("work"), lambda: False),
    ):
        pass


class Frames(BaseModel):
    """A request for some frames."""

    name: str
    num: int
    priority: int = 0


class FrameJobs(JobKind[Frames]):
    """Jobs whose finished frames are files."""

    name, placeholder = "render", Frames(name="unknown", num=1)

    def steps(self, request: Frames) -> int:
        return request.num

    def is_first(self, request: Frames) -> bool:
        return False

    def priority(self, request: Frames) -> int:
        return request.priority

    def run(self, run: JobRun[Frames]) -> None:
        missing = [k for k in range(run.job.total) if not (run.folder / str(k)).exists()]
        done = run.job.total - len(missing)
        run.record(done)
        values = {k: {"path": str(run.folder / str(k)), "name": run.job.request.name} for k in missing}
        run.timed_steps("frame", values, done)


class Machine:
    """Runs steps in their threads, in fair slots, and records them."""

    def __init__(self, num_slots: int = 1) -> None:
        self.slots = FairSlots(lambda: num_slots, {})
        self.done: list[str] = []
        self.running: set[str] = set()
        self.peak = 0
        self.before: Callable[[str, IsNeeded], None] = lambda path, is_needed: None

    def run(self, step: Step, report: ProgressCallback, is_needed: IsNeeded) -> Mapping[str, Any]:
        path = step.values["path"]
        with self.slots.take(step, is_needed):
            assert path not in self.running, "two do the same"
            self.running.add(path)
            self.peak = max(self.peak, len(self.running))
            try:
                self.before(path, is_needed)
                time.sleep(0.01)
                Path(path).write_text("done")
            finally:
                self.running.remove(path)
        self.done.append(step.values["name"])
        return {}


class Jobs:
    """One service with its kind of jobs."""

    def __init__(self, ledger: Ledger, folder: Path, machine: Machine, num_slots: int = 1, quota: int = 99) -> None:
        rows = JobLedger(ledger.sessions, Quota(quota, quota - 1), new_owner())
        self.service = JobService(rows, {})
        self.service.use_steps(machine.run, lambda: num_slots, str)
        self.frames = FrameJobs(self.service, folder)

    def submit(self, name: str, client: str = "", num: int = 2) -> str:
        return self.frames.submit(Frames(name=name, num=num), client)

    def wait(self, identity: str, state: str = "ready") -> None:
        wait_for(lambda: self.frames.get(identity).state == state)


@pytest.fixture
def ledger(tmp_path: Path) -> Iterator[Ledger]:
    with closing(Ledger(open_database(f"sqlite:///{tmp_path / 'a.db'}"))) as opened:
        yield opened


def test_steps_of_clients_alternate_and_each_client_has_a_quota(tmp_path: Path, ledger: Ledger) -> None:
    machine = Machine()
    jobs = Jobs(ledger, tmp_path, machine, quota=3)
    last = [jobs.submit("a", "ann", 4), jobs.submit("A", "ann", 4)][-1]
    with pytest.raises(QuotaError, match=r"you have reached the limit of .*RELUME_MAX_QUEUED_PER_USER"):
        jobs.submit("x", "ann")
    jobs.submit("b", "bob", 4)
    with pytest.raises(BusyError, match=r"limit of 3 unfinished renders is reached; .*RELUME_MAX_QUEUED\)"):
        jobs.submit("x", "cem")
    may_begin = threading.Event()
    machine.before = lambda path, is_needed: wait_for(may_begin.is_set)
    jobs.service.start()
    wait_for(lambda: len(machine.slots._waiting) == 2)  # one has the slot
    may_begin.set()
    jobs.wait(last)
    wait_for(lambda: not jobs.service._runs)
    jobs.service.close()
    assert sorted(machine.done) == sorted("aAb" * 4)
    assert machine.done[:7].count("b") >= 3, "bob has half of the turns while he waits"


def test_steps_of_a_higher_priority_run_first_and_the_row_has_it(tmp_path: Path, ledger: Ledger) -> None:
    """A job holds the slot while an older and a more urgent one wait for it."""
    machine, may_end = Machine(), threading.Event()
    machine.before = lambda path, is_needed: wait_for(may_end.is_set)
    jobs = Jobs(ledger, tmp_path, machine)
    jobs.service.start()
    jobs.submit("holder", num=1)
    wait_for(lambda: len(machine.running) == 1)
    older = jobs.submit("older", num=1)
    urgent = jobs.frames.submit(Frames(name="urgent", num=1, priority=5))
    with ledger.sessions() as session:
        assert session.scalar(select(JobRow.priority).where(JobRow.id == urgent)) == 5
    wait_for(lambda: len(machine.slots._waiting) == 2)
    may_end.set()
    jobs.wait(older)
    jobs.service.close()
    assert machine.done == ["holder", "urgent", "older"]


def test_job_is_deleted_if_the_ledger_has_no_disk_space(
    tmp_path: Path, ledger: Ledger, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its files are deleted first, which makes room for the ledger."""
    jobs = Jobs(ledger, tmp_path, Machine())
    jobs.service.start()
    identity = jobs.submit("a")
    jobs.wait(identity)
    delete = jobs.service.ledger.delete

    def delete_where_there_is_room(identities: Sequence[str]) -> Any:
        if (tmp_path / identities[0]).exists():
            raise DiskFullError("the database")
        return delete(identities)

    monkeypatch.setattr(jobs.service.ledger, "delete", delete_where_there_is_room)
    jobs.frames.delete(identity)
    jobs.service.close()
    assert not (tmp_path / identity).exists()
    assert not jobs.service.ledger.exists(identity)


def test_job_that_waits_for_disk_space_says_so(tmp_path: Path, ledger: Ledger) -> None:
    """The ledger cannot store the reason; the job goes on by itself, and then there is none."""
    jobs = Jobs(ledger, tmp_path, Machine())
    identity = jobs.submit("a")
    jobs.frames.on_blocked(identity, DiskFullError("the database"))
    assert "the disk is full; free some space, then try again; the job resumes by itself" in str(
        jobs.frames.get(identity).problem
    )
    jobs.service.start()
    jobs.wait(identity)
    jobs.service.close()
    assert jobs.frames.get(identity).problem is None


def test_leases_that_cannot_be_renewed_are_logged_once_until_they_are(
    tmp_path: Path, ledger: Ledger, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A full disk can be read: polling the queue succeeds meanwhile."""
    monkeypatch.setattr("relume_worker.jobs.job_service.RENEW_S", 0.001)
    monkeypatch.setattr("relume_worker.jobs.job_service.POLL_INTERVAL_S", 0.001)
    service, num_renewals, num_polls, is_full = Jobs(ledger, tmp_path, Machine()).service, 0, 0, True

    def claimable(*_: object) -> list[Waiting]:
        nonlocal num_polls
        num_polls += 1
        return []

    def renew_leases() -> None:
        nonlocal num_renewals
        num_renewals += 1
        if is_full:
            raise DiskFullError("the database")

    monkeypatch.setattr(service.ledger, "claimable", claimable)
    monkeypatch.setattr(service.ledger, "renew_leases", renew_leases)
    service._runs["a"] = Waiting("a", "ann", False, 1.0), threading.Thread()
    service.start()
    wait_for(lambda: min(num_renewals, num_polls) >= 5)
    messages = [record.getMessage().split(" (")[0] for record in caplog.records]
    is_full, num_renewals = False, 0
    wait_for(lambda: num_renewals >= 3)
    service.close()
    assert messages == ["the leases of jobs cannot be renewed"]
    assert [record.getMessage() for record in caplog.records[1:]] == ["the leases of jobs cannot be renewed: resolved"]


def test_frames_of_one_job_take_all_slots(tmp_path: Path, ledger: Ledger) -> None:
    machine = Machine(3)
    jobs = Jobs(ledger, tmp_path, machine, num_slots=3)
    jobs.service.start()
    jobs.wait(jobs.submit("a", num=12))
    jobs.service.close()
    assert (machine.peak, len(machine.done)) == (3, 12)


def test_two_services_repeat_no_step_and_resume_abandoned_jobs(tmp_path: Path, ledger: Ledger) -> None:
    machine = Machine(9)
    services = [Jobs(ledger, tmp_path, machine) for _ in range(2)]
    identities = [services[0].submit(name, num=4) for name in "abcdefghij"]
    gone = f"{new_owner().split('/')[0]}/{2**22 + 1}/nobody/0"  # no process has this id
    with ledger.sessions.begin() as session:
        session.execute(update(JobRow).values(owner=gone, heartbeat=time.time(), state="running"))
    for jobs in services:
        jobs.service.start()
    for identity in identities:
        services[1].wait(identity)
    for jobs in services:
        jobs.service.close()
    with ledger.sessions() as session:
        assert session.scalars(select(JobRow.owner)).all() == [None] * 10
    assert sorted(machine.done) == sorted("abcdefghij" * 4)


def test_failed_step_fails_the_job_and_the_rest_resumes(tmp_path: Path, ledger: Ledger) -> None:
    machine = Machine(2)
    jobs = Jobs(ledger, tmp_path, machine, num_slots=2)

    def fail(path: str, is_needed: IsNeeded) -> None:
        if path.endswith("/1"):
            raise RelumeError("memory ran out; give a smaller size")

    machine.before = fail
    jobs.service.start()
    identity = jobs.submit("a", num=6)
    jobs.wait(identity, "failed")
    assert jobs.frames.get(identity).problem == "memory ran out; give a smaller size"
    before, machine.before = len(machine.done), lambda path, is_needed: None
    jobs.frames.resume(identity)
    jobs.wait(identity)
    jobs.service.close()
    assert before < 6
    assert len(machine.done) == 6, "finished frames are not rendered again"


def test_job_whose_disk_fills_up_fails_and_resumes(
    tmp_path: Path, ledger: Ledger, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = Machine()
    jobs = Jobs(ledger, tmp_path, machine)

    def free(path: Path) -> SimpleNamespace:
        return SimpleNamespace(free=RESERVE_BYTES - (len(machine.done) == 2))

    monkeypatch.setattr("shutil.disk_usage", free)
    jobs.service.start()
    identity = jobs.submit("a", num=4)
    jobs.wait(identity, "failed")
    assert jobs.frames.get(identity).problem == (
        "the files of a render cannot be written, the disk is full; free some space, then try again"
    )
    assert sorted(path.name for path in (tmp_path / identity).glob("[0-9]")) == ["0", "1"]
    machine.done.append("deleted files")
    jobs.frames.resume(identity)
    jobs.wait(identity)
    jobs.service.close()
    assert machine.done == ["a", "a", "deleted files", "a", "a"]


@pytest.mark.parametrize("end", ["stop", "delete", "close"])
def test_job_ends_at_once_when_it_is_not_wanted(tmp_path: Path, ledger: Ledger, end: str) -> None:
    machine, has_begun = Machine(2), threading.Event()
    jobs = Jobs(ledger, tmp_path, machine, num_slots=2)

    def hang(path: str, is_needed: IsNeeded) -> None:
        has_begun.set()
        wait_for(lambda: not is_needed())
        raise CancelledError("stopped")

    machine.before = hang
    jobs.service.start()
    identity = jobs.submit("a", num=6)
    assert has_begun.wait(30)
    {"stop": jobs.frames.stop, "delete": jobs.frames.delete, "close": lambda _: jobs.service.close()}[end](identity)
    wait_for(lambda: not jobs.service._runs)
    if end == "delete":
        wait_for(lambda: not (tmp_path / identity).exists())
    else:
        assert jobs.frames.get(identity).state == ("canceled" if end == "stop" else "running")
    if end != "close":
        jobs.service.close()
    with ledger.sessions() as session:
        assert session.scalars(select(JobRow.owner)).all() == ([] if end == "delete" else [None])
    assert machine.done == []
