"""Batch processes: killed, stopped and replaced; and fair scheduling."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select, update

from relume.core.errors import CancelledError, NotFoundError, RelumeError, StoreError, StoreNotFoundError
from relume.core.memory_usage import resident_bytes
from relume_server.batch import process as processes
from relume_server.batch.pool import ProcessPool
from relume_server.batch.step import Step
from relume_server.errors import BusyError, QuotaError
from relume_server.jobs.job import Quota
from relume_server.jobs.queue import JobQueue
from relume_server.persistence.tables import RenderRow
from relume_server.schemas.renders import RENDER_PLACEHOLDER, RenderRequest
from relume_worker.database import open_database
from relume_worker.fair_share import FairShare, WaitingBake
from relume_worker.lease import new_owner
from relume_worker.ledger import Ledger

STAND_IN = """
import json, os, sys, time
for line in sys.stdin:
    message = json.loads(line)
    if message == "stop":
        continue
    kind = message["kind"]
    if kind == "grow":
        held = bytearray(1 << 28)
    if kind == "fail":
        print(json.dumps({"problem": "no.", **message["values"]}), flush=True)
        continue
    if kind == "hang":
        print(json.dumps({"share": 0.5}), flush=True)
        time.sleep(600)
    if kind == "die" or (kind == "die once" and not os.path.exists(message["values"]["mark"])):
        open(message["values"]["mark"], "a").write("died ")
        os._exit(9)
    print(json.dumps({"answer": {"pid": os.getpid()}}), flush=True)
"""
"""A process that speaks as `relume_server.batch.process_main` does, and starts at once."""


def ignore(share: float) -> None:
    pass


def always() -> bool:
    return True


@pytest.fixture
def pool(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ProcessPool]:
    monkeypatch.setattr(processes, "COMMAND", ["-c", STAND_IN])
    new_pool = ProcessPool(tmp_path, 1, 1 << 20, 1, 0, idle_s=0.0)
    yield new_pool
    new_pool.close()


def test_process_is_reused_between_steps_and_ends_when_idle(pool: ProcessPool) -> None:
    first, second = (pool.run(Step("work"), ignore, always)["pid"] for _ in range(2))
    assert [first] == [second] == pool.pids()
    assert pool.resident_bytes() > 0
    pool.release()
    assert pool.pids() == []
    assert resident_bytes(first) == 0
    assert pool.run(Step("work"), ignore, always)["pid"] != first


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ({}, RelumeError),
        ({"kind": "defect"}, RelumeError),
        ({"kind": "store-not-found"}, StoreNotFoundError),
        ({"kind": "store"}, StoreError),
        ({"kind": "not-found"}, NotFoundError),
    ],
)
def test_errors_of_the_process_are_raised_in_the_caller(
    pool: ProcessPool, values: dict[str, str], kind: type[Exception]
) -> None:
    with pytest.raises(RelumeError, match="no") as met:
        pool.run(Step("fail", values=values), ignore, always)
    assert met.type is kind


def test_step_is_retried_once_and_then_fails_with_a_message(pool: ProcessPool, tmp_path: Path) -> None:
    values = {"mark": str(tmp_path / "once")}
    assert pool.run(Step("die once", values=values), ignore, always)["pid"] > 0
    mark = tmp_path / "twice"
    with pytest.raises(RelumeError, match=r"was killed twice.*; give a smaller size"):
        pool.run(Step("die", values={"mark": str(mark)}), ignore, always)
    assert mark.read_text() == "died died "
    assert pool.run(Step("work"), ignore, always)["pid"] > 0


def test_failed_step_reports_its_reason(pool: ProcessPool) -> None:
    with pytest.raises(RelumeError, match=r"^no\.$"):
        pool.run(Step("fail"), ignore, always)
    assert len(pool.pids()) == 1


def test_step_that_ignores_cancellation_is_killed(pool: ProcessPool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "_STOP_S", 0.05)
    running, reports = threading.Event(), []

    def tell(share: float) -> None:
        reports.extend([share, *pool.pids()])
        running.set()

    with pytest.raises(CancelledError):
        pool.run(Step("hang"), tell, lambda: not running.is_set())
    share, pid = reports
    assert share == 0.5
    assert resident_bytes(pid) == 0
    assert pool.run(Step("work"), ignore, always)["pid"] != pid


def test_process_that_uses_too_much_memory_is_replaced(pool: ProcessPool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_server.batch.pool._PROGRAM_BYTES", 1 << 27)
    small = pool.run(Step("work"), ignore, always)["pid"]
    assert pool.run(Step("grow"), ignore, always)["pid"] == small
    assert pool.pids() == []


def test_interactive_steps_run_before_earlier_ones(pool: ProcessPool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "_STOP_S", 0.05)
    order: list[str] = []
    gate = threading.Event()

    def run(name: str, is_first: bool) -> None:
        pool.run(Step("work", is_first), ignore, always)
        order.append(name)

    def hang() -> None:
        with suppress(CancelledError):
            pool.run(Step("hang"), ignore, lambda: not gate.is_set())

    held = threading.Thread(target=hang)
    held.start()
    wait_for(lambda: bool(pool.pids()))
    threads = []
    for name, is_first in (("animation", False), ("picture", True)):
        threads.append(threading.Thread(target=run, args=(name, is_first)))
        threads[-1].start()
        wait_for(lambda: len(pool._waiting) == len(threads))
    gate.set()
    for thread in (held, *threads):
        thread.join(30)
    assert order == ["picture", "animation"]


def wait_for(is_reached: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30
    while not is_reached():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def next_client(turns: FairShare, waiting: Sequence[WaitingBake]) -> WaitingBake:
    first = turns.sort(waiting)[0]
    turns.pick_next(first.client)
    return first


def test_clients_take_turns_and_small_jobs_go_first() -> None:
    turns = FairShare({})
    waiting = [
        WaitingBake("a1", "ann", False, 1.0),
        WaitingBake("a2", "ann", False, 2.0),
        WaitingBake("b1", "bob", False, 3.0),
    ]
    assert [next_client(turns, waiting).id for _ in range(4)] == ["a1", "b1", "a1", "b1"]
    waiting.append(WaitingBake("a3", "ann", True, 4.0))
    assert [next_client(turns, waiting).id for _ in range(2)] == ["a3", "a3"]
    del waiting[0], waiting[-1]
    waiting.append(WaitingBake("c1", "cem", False, 5.0))
    assert [next_client(turns, waiting).id for _ in range(6)] == ["b1", "c1", "b1", "c1", "a2", "b1"]


def test_weights_set_the_number_of_turns() -> None:
    turns = FairShare({"ann": 3.0})
    waiting = [WaitingBake("b", "bob", False, 1.0), WaitingBake("a", "ann", False, 2.0)]
    assert "".join(next_client(turns, waiting).id for _ in range(12)).count("a") == 9
    assert next_client(turns, [WaitingBake("b", "bob", False, 1.0), WaitingBake("c", "cem", False, 0.0)]).id == "c"


class Counting(JobQueue[RenderRequest]):
    """A queue whose steps only record their client."""

    row, noun, placeholder = RenderRow, "render", RENDER_PLACEHOLDER

    def steps(self, request: RenderRequest) -> int:
        return request.num_frames

    def step_s(self, request: RenderRequest) -> float | None:
        return None

    def is_first(self, request: RenderRequest) -> bool:
        return False

    def step(self, work: Any, timer: Any) -> int:
        self.record_progress(work.id, work.completed)
        self.run_in_process(work, str(work.request.name), {}, ignore)
        return int(work.completed) + 1


def test_steps_of_clients_alternate_and_each_client_has_a_quota(tmp_path: Path) -> None:
    done: list[str] = []

    def run(step: Step, tell: object, is_wanted: Callable[[], bool]) -> Mapping[str, Any]:
        assert is_wanted()
        done.append(step.kind)
        return {}

    with closing(Ledger(open_database(f"sqlite:///{tmp_path / 'a.db'}"))) as ledger:
        queue = Counting(ledger.sessions, tmp_path / "renders", run, Quota(max_total=3, max_per_client=2))

        def submit(name: str, client: str) -> str:
            asked = {"bake": "0" * 16, "view": "front", "format": "png", "looks": [{}] * 2, "name": name}
            return queue.submit(RenderRequest.model_validate(asked), client)

        last = [submit("a", "ann"), submit("A", "ann")][-1]
        with pytest.raises(QuotaError, match=r"you have reached the limit of .*RELUME_MAX_QUEUED_PER_USER"):
            submit("x", "ann")
        submit("b", "bob")
        with pytest.raises(BusyError, match=r"limit of 3 unfinished renders is reached; .*RELUME_MAX_QUEUED\)"):
            submit("x", "cem")
        queue.start()
        wait_for(lambda: queue.get(last).state == "ready")
        queue.close()
    assert done == ["a", "b", "a", "b", "A", "A"]


def test_two_servers_repeat_no_step_and_resume_abandoned_jobs(tmp_path: Path) -> None:
    done: list[str] = []
    at_work: set[str] = set()

    def run(step: Step, tell: object, is_wanted: Callable[[], bool]) -> Mapping[str, Any]:
        assert step.kind not in at_work, "two do the same"
        at_work.add(step.kind)
        time.sleep(0.01)
        at_work.remove(step.kind)
        done.append(step.kind)
        return {}

    with closing(Ledger(open_database(f"sqlite:///{tmp_path / 'a.db'}"))) as ledger:
        queues = [Counting(ledger.sessions, tmp_path / "renders", run, Quota(9, 9)) for _ in range(2)]
        asked = {"bake": "0" * 16, "view": "front", "format": "png"}
        works = {
            name: queues[0].submit(RenderRequest.model_validate({**asked, "looks": [{}] * 4, "name": name}))
            for name in "abc"
        }
        gone = f"{new_owner().split('/')[0]}/{2**22 + 1}/nobody/0"  # no process has this id
        with ledger.sessions.begin() as session:
            session.execute(update(RenderRow).values(owner=gone, heartbeat=time.time(), state="running"))
        for queue in queues:
            queue.start()
        wait_for(lambda: all(queues[1].get(work).state == "ready" for work in works.values()))
        for queue in queues:
            queue.close()
        with ledger.sessions() as session:
            assert session.scalars(select(RenderRow.owner)).all() == [None] * 3
    assert sorted(done) == sorted("abc" * 4)


def test_exiting_process_gets_no_more_steps(pool: ProcessPool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("subprocess.Popen.poll", lambda process: process.returncode)  # until somebody waits for it
    assert pool.run(Step("die once", values={"mark": str(tmp_path / "once")}), ignore, always)["pid"] > 0
