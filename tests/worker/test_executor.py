"""Tasks and processes when a cluster fails; the clusters here are fakes."""

import asyncio
import concurrent.futures
import errno
import logging
import os
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable, Coroutine
from typing import Any

import pytest
from coroutines import run_in_thread

from relume.core.errors import PlanError
from relume_worker.dask_executor import DaskExecutor
from relume_worker.executor import BAKE_NICE, BULK, Executors


class FakeTask:
    """A Dask future: awaiting it returns its outcome or raises it."""

    def __init__(self, outcome: object) -> None:
        self.outcome = outcome

    def __await__(self) -> Any:
        yield from asyncio.sleep(0).__await__()
        if isinstance(self.outcome, Exception):
            raise self.outcome
        return self.outcome


class FakeClient:
    status = "running"

    def __init__(self, *_: object, **__: object) -> None:
        self.loop = self

    def submit(self, fn: Callable[..., object], *args: object, **_: object) -> FakeTask:
        return FakeTask(fn(*args))

    def add_callback(self, follow: Callable[..., Coroutine[Any, Any, None]], *args: object) -> None:
        run_in_thread(follow(*args))

    def close(self, timeout: float) -> None:
        raise TimeoutError


class FakeCluster:
    """One worker process runs and another is starting, so closing fails as in Dask."""

    def __init__(self, **_: object) -> None:
        self.log: list[str] = []
        self.workers = {0: FakeNanny(self.log), 1: FakeNanny(self.log)}

    def sync(self, work: Callable[..., Coroutine[Any, Any, None]], *args: object, callback_timeout: float) -> None:
        run_in_thread(work(*args))

    def close(self, timeout: float) -> None:
        self.log.append("close")
        raise AssertionError("can only join a started process")


class FakeNanny:
    def __init__(self, log: list[str]) -> None:
        self.log = log
        self.process = self  # Dask's nanny holds the process through a wrapper
        self.close_gracefully = lambda: log.append("no restart")

    async def kill(self) -> None:
        self.log.append("kill")


def submit(outcome: object) -> "concurrent.futures.Future[Any]":
    return DaskExecutor(FakeClient(), BULK).submit(lambda: outcome)


def test_future_has_the_result_or_the_error_of_its_task() -> None:
    assert submit(7).result(0) == 7
    with pytest.raises(ZeroDivisionError):
        submit(ZeroDivisionError()).result(0)


def test_expected_errors_return_as_results_that_dask_does_not_log(monkeypatch: pytest.MonkeyPatch) -> None:
    handed: list[object] = []

    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    client = FakeClient()
    monkeypatch.setattr(client, "submit", lambda fn, *args, **_: handed.append(fn(*args)) or FakeTask(handed[-1]))
    with pytest.raises(OSError, match="No space"):
        DaskExecutor(client, BULK).submit(full).result(0)
    assert handed


def test_future_of_a_lost_task_wakes_its_waiters() -> None:
    future = submit(concurrent.futures.CancelledError())
    assert concurrent.futures.wait([future], timeout=0).done == {future}
    assert future.cancelled()


def test_cluster_that_fails_to_close_is_killed_without_blocking(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    clusters: list[FakeCluster] = []
    monkeypatch.setattr("distributed.LocalCluster", lambda **_: clusters.append(FakeCluster()) or clusters[-1])
    monkeypatch.setattr("distributed.Client", FakeClient)
    executors = Executors(num_workers=2)
    executors.cluster()
    executors.close()
    assert not logging.getLogger("distributed.batched").isEnabledFor(logging.INFO)
    assert clusters[0].log == ["no restart", "kill"] * 2 + ["close"]
    assert "can only join a started process" in caplog.text
    executors.close()  # nothing is left to stop
    assert clusters[0].log.count("close") == 1


ASK = """
import sys
from distributed import Client

try:
    Client(sys.argv[1], timeout=5).run_on_scheduler(print, "it runs what it is sent")
finally:
    print("asked", flush=True)
"""


@pytest.mark.slow
def test_local_cluster_rejects_clients_without_its_key() -> None:
    """Every local account can reach its ports; scheduler and workers require the key on each."""
    executors = Executors(num_workers=1)
    try:
        assert executors.cluster().submit(sum, [1, 2]).result() == 3
        cluster = executors._cluster
        addresses = [cluster.scheduler_address, *(nanny.worker_address for nanny in cluster.workers.values())]
        addresses += [nanny.address for nanny in cluster.workers.values()]
        assert all(address.startswith("tls://127.0.0.1:") for address in addresses)
        for address in addresses:
            for asked in (address, address.replace("tls:", "tcp:")):
                said = subprocess.run([sys.executable, "-c", ASK, asked], capture_output=True, text=True, check=False)
                assert (said.returncode, said.stdout) == (1, "asked\n"), said.stderr
        port = cluster.scheduler.http_server.port
        for page in ("info/main/workers.html", "json/counts.json", "metrics"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(f"http://127.0.0.1:{port}/{page}")
    finally:
        executors.close()


def test_external_cluster_without_tls_reports_the_missing_settings() -> None:
    with pytest.raises(PlanError, match="DASK_DISTRIBUTED__COMM__TLS__CA_FILE"):
        Executors("tls://127.0.0.1:1").cluster()


def test_worker_processes_have_low_priority_and_the_server_keeps_no_messages_to_them() -> None:
    executors = Executors(num_workers=1)
    assert not executors.has_cluster
    try:
        executors.cluster()
        streams = executors._cluster.scheduler.stream_comms.values()
        assert [stream.recent_message_log.maxlen for stream in streams] == [0]
        niceness = executors.cluster().submit(os.getpriority, os.PRIO_PROCESS, 0).result(60)
        assert executors.has_cluster
    finally:
        executors.close()
    assert niceness == min(19, os.getpriority(os.PRIO_PROCESS, 0) + BAKE_NICE)
