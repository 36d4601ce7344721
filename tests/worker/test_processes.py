"""Real processes that are really killed: the resulting store is bit-identical."""

import gc
import hashlib
import json
import logging
import os
import signal
import socket
import subprocess
import sys
import time
import warnings
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import dask
import pytest
from distributed.security import Security
from fake_method import RECIPE, FakeMethod, tiny_scene

from relume.core.errors import PlanError
from relume.store.run_bake import bake_in_process
from relume_worker.database import open_database
from relume_worker.executor import TINY_BAKE_RAYS, Executors
from relume_worker.ledger import Ledger
from relume_worker.paths import bake_path
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService
from relume_worker.status import bake_id

IDENTITY = bake_id(tiny_scene().id, RECIPE)
LARGE = TINY_BAKE_RAYS + 1
NUM_TASKS = 2 + 2 * 9
COMM = "DASK_DISTRIBUTED__COMM__"
PROGRAM = Path(__file__).with_name("bake_process.py")


def tree_hash(folder: Path) -> str:
    digest = hashlib.sha256()
    for file in sorted(p for p in folder.rglob("*") if p.is_file()):
        digest.update(str(file.relative_to(folder)).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> str:
    return tree_hash(
        bake_in_process(FakeMethod(), tiny_scene(), RECIPE, tmp_path_factory.mktemp("expected") / "s.zarr")
    )


def start(data_dir: Path, url: str, **method: Any) -> "subprocess.Popen[str]":
    command = [sys.executable, str(PROGRAM), str(data_dir), url, json.dumps(method), "2"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def finish(process: "subprocess.Popen[str]") -> list[str]:
    output, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    return output.splitlines()


def wait_for(log: Path, num_tasks: int) -> None:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        if log.exists() and len(log.read_text().split()) >= num_tasks:
            return
        time.sleep(0.02)
    pytest.fail("the bake did not get under way")


def test_worker_killed_during_a_task_is_replaced_and_a_task_that_kills_all_fails_clearly(
    tmp_path: Path, expected: str, caplog: pytest.LogCaptureFixture
) -> None:
    log = tmp_path / "log"
    once = FakeMethod(num_rays=LARGE, delay_s=0.02, log=str(log), kill="once")
    methods = {"fake": once, "deadly": FakeMethod("deadly", num_rays=LARGE, log=str(log), kill="always")}
    with BakeService(tmp_path / "data", num_workers=2, methods=methods) as service:
        scene = register_scene(service.data_dir, service.ledger, tiny_scene())
        last = {}
        for method in methods:
            identity = service.submit(scene, replace(RECIPE, method=method))
            with service.subscribe(identity) as changes:
                last[method] = list(changes)[-1]
            assert (tmp_path / "log.died").exists()
            if method == "fake":
                said = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
                assert said == ["a worker process died; its tasks go to another"]
    assert last["fake"].state == "ready"
    assert tree_hash(bake_path(tmp_path / "data", IDENTITY)) == expected
    assert last["deadly"].state == "failed"
    assert "worker processes died in the same task" in last["deadly"].problem
    assert not bake_path(tmp_path / "data", identity).exists()


@pytest.mark.parametrize(
    ("ledger_url", "num_rays"),
    [
        pytest.param("sqlite", 1000, id="in the service's process", marks=pytest.mark.slow),
        pytest.param("postgresql", 1000, id="its ledger on PostgreSQL"),
        pytest.param("sqlite", LARGE, id="on a cluster", marks=pytest.mark.slow),
    ],
    indirect=["ledger_url"],
)
def test_bake_resumes_from_the_ledger_after_all_processes_are_killed(
    tmp_path: Path, ledger_url: str, expected: str, num_rays: int
) -> None:
    log, data_dir = tmp_path / "log", tmp_path / "data"
    process = start(data_dir, ledger_url, num_rays=num_rays, delay_s=0.1, log=str(log))
    wait_for(log, 8)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    ledger = Ledger(open_database(ledger_url))
    assert ledger.bake(IDENTITY).state == "running"
    done = ledger.finished_tasks(IDENTITY)
    ledger.close()
    assert 3 <= len(done) < NUM_TASKS
    assert not bake_path(data_dir, IDENTITY).exists()
    before = Counter(log.read_text().split())

    assert finish(start(data_dir, ledger_url, num_rays=num_rays, log=str(log)))[-1].startswith("ready")
    assert tree_hash(bake_path(data_dir, IDENTITY)) == expected
    repeated = Counter(log.read_text().split()) - before
    assert not set(repeated) & {f"{stage}.{index}" for stage, index in done}


@pytest.mark.parametrize(
    "ledger_url",
    [pytest.param("sqlite", marks=pytest.mark.slow), "postgresql"],  # test_service has two services on SQLite
    indirect=True,
)
def test_two_processes_bake_one_recipe_once(tmp_path: Path, ledger_url: str, expected: str) -> None:
    log = tmp_path / "log"
    processes = [start(tmp_path / "data", ledger_url, delay_s=0.02, log=str(log)) for _ in range(2)]
    assert [finish(process)[-1].split()[0] for process in processes] == ["ready", "ready"]
    assert set(Counter(log.read_text().split()).values()) == {1}
    assert tree_hash(bake_path(tmp_path / "data", IDENTITY)) == expected


@pytest.mark.slow
def test_idle_workers_exit_and_new_ones_start_for_the_next_bake(
    tmp_path: Path, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RELUME_IDLE_SECONDS", "1")
    with BakeService(tmp_path, num_workers=1, methods={"fake": FakeMethod(num_rays=LARGE)}) as service:
        register_scene(service.data_dir, service.ledger, tiny_scene())
        for size in (RECIPE.size, (16, 16)):
            identity = service.submit(tiny_scene().id, replace(RECIPE, size=size))
            with service.subscribe(identity) as changes:
                resident = [service.executors.resident_bytes() for _ in changes]
            assert service.get(identity).state == "ready"
            assert max(resident) > 50e6
            deadline = time.monotonic() + 60
            while service.executors.resident_bytes() and time.monotonic() < deadline:
                time.sleep(0.1)
            assert service.executors.resident_bytes() == 0
        assert tree_hash(service.store_path(IDENTITY)) == expected


@pytest.mark.slow
def test_scheduler_is_disposable(tmp_path: Path, expected: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scheduler and workers of a real cluster are killed during a bake; the bake resumes on new ones."""
    monkeypatch.setenv("PYTHONPATH", str(PROGRAM.parent))
    log = tmp_path / "log"
    method = FakeMethod(num_rays=LARGE, delay_s=0.1, log=str(log))
    with Cluster() as cluster:
        service = BakeService(tmp_path / "data", scheduler=cluster.address, methods={"fake": method})
        register_scene(service.data_dir, service.ledger, tiny_scene())
        with service:
            service.submit(tiny_scene().id, RECIPE)
            wait_for(log, 8)
            cluster.kill()
            with service.subscribe(IDENTITY) as changes:
                status = list(changes)[-1]
            assert status.state == "failed"
            assert "scheduler" in (status.problem or "")
            cluster.start()
            service.submit(tiny_scene().id, RECIPE)
            with service.subscribe(IDENTITY) as changes:
                status = list(changes)[-1]
            assert (status.state, status.problem) == ("ready", None)
    assert tree_hash(bake_path(tmp_path / "data", IDENTITY)) == expected


@pytest.mark.slow
def test_external_cluster_uses_tls_certificates_of_the_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Security.temporary()
    for name, text in (("ca.pem", made.tls_ca_file), ("key.pem", made.tls_client_key)):
        (tmp_path / name).write_text(text)
    cert, key = str(tmp_path / "ca.pem"), str(tmp_path / "key.pem")
    settings = {"require-encryption": "true", "tls.ca-file": cert}
    for role in ("scheduler", "worker", "client"):
        settings |= {f"tls.{role}.cert": cert, f"tls.{role}.key": key}
    for name, value in settings.items():
        monkeypatch.setenv(COMM + name.upper().replace(".", "__").replace("-", "_"), value)
    with Cluster("tls") as cluster:
        executors = Executors(cluster.address)
        ours = {
            f"distributed.comm.{name}": value for name, value in settings.items()
        }  # this process has already started
        with dask.config.set(ours), closing(executors):
            assert executors.cluster().submit(sum, [1, 2]).result(60) == 3
        with pytest.raises(PlanError, match=f"{COMM}TLS__CA_FILE"):
            Executors(cluster.address).cluster()


class Cluster:
    """A scheduler and a `relume worker` that joins it, as processes."""

    def __init__(self, scheme: str = "tcp") -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        self.address = f"{scheme}://127.0.0.1:{self.port}"
        self.processes: list[subprocess.Popen[bytes]] = []

    def start(self) -> None:
        scheduler = [
            "distributed.cli.dask_scheduler",
            "--host",
            "127.0.0.1",
            "--port",
            str(self.port),
            "--no-dashboard",
        ]
        for arguments in (scheduler, ["relume_cli.main", "worker", "--scheduler", self.address, "--processes", "1"]):
            command = [sys.executable, "-m", *arguments]
            self.processes.append(subprocess.Popen(command, stderr=subprocess.DEVNULL))
            self._wait_for_port()

    def kill(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()
        self.processes.clear()

    def _wait_for_port(self) -> None:
        for _ in range(600):
            try:
                socket.create_connection(("127.0.0.1", self.port), timeout=1).close()
            except OSError:
                time.sleep(0.05)
            else:
                return
        pytest.fail("the scheduler did not start")

    def __enter__(self) -> "Cluster":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()
        with warnings.catch_warnings():  # Dask's client leaves its socket to a killed scheduler open
            warnings.simplefilter("ignore", ResourceWarning)
            gc.collect()
