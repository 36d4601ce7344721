"""Responses and log lines of a server while its disk or database fails."""

import errno
import logging
import os
import time
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import pytest
from fastapi.testclient import TestClient
from postgres import make_unavailable_error
from server_fakes import write_tiny_scene
from session_client import Baked

from relume.core.errors import DiskFullError, MaterialError, RelumeError, SceneError
from relume.store.disk_space import RESERVE_BYTES
from relume_server.batch.cluster_steps import _answer
from relume_server.errors import NearlyFullError, make_problem
from relume_server.io import import_request
from relume_server.io.import_request import ImportRequest, run_import
from relume_server.settings import Settings


class Usage(NamedTuple):
    """The result of `shutil.disk_usage`."""

    total: int
    used: int
    free: int


def test_damaged_database_is_one_sentence_and_one_log_line(
    client: TestClient, settings: Settings, caplog: pytest.LogCaptureFixture
) -> None:
    for file in (settings.data / "relume.db", settings.data / "relume.db-wal"):
        with file.open("r+b") as opened:  # keep its size: it is memory-mapped
            opened.write(bytes(range(256)) * (file.stat().st_size // 256))
    client.app.state.services.bakes.ledger.close()  # type: ignore[attr-defined]  # drop cached pages
    caplog.clear()
    with caplog.at_level(logging.ERROR):
        for path in ("/api/bakes", "/readyz"):
            answer = client.get(path)
            assert answer.status_code == 503
            assert answer.json()["type"] == "urn:relume:problem:database"
            assert "put a backup of relume.db in its place" in answer.json()["detail"]
    said = [record for record in caplog.records if record.name == "relume_server.errors"]
    assert len(said) == 2
    assert not any(record.exc_info or "\n" in record.getMessage() for record in caplog.records)


def test_readiness_is_checked_once_a_second_for_all_callers(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    num_checks = 0

    def check_room() -> None:
        nonlocal num_checks
        num_checks += 1
        raise NearlyFullError("full")

    monkeypatch.setattr("relume_server.runtime.recent_check.MAX_AGE_S", 1e9)
    monkeypatch.setattr(client.app.state.services.access.quotas, "check_room", check_room)  # type: ignore[attr-defined]
    with ThreadPoolExecutor(5) as threads:
        assert [*threads.map(lambda _: client.get("/readyz").status_code, range(50))] == [507] * 50
    assert num_checks == 1
    monkeypatch.setattr("relume_server.runtime.recent_check.MAX_AGE_S", 0.0)
    assert (client.get("/readyz").status_code, num_checks) == (507, 2)


def test_nearly_full_disk_is_not_ready_and_logged_once(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("relume_server.runtime.recent_check.MAX_AGE_S", 0.0)
    monkeypatch.setattr("shutil.disk_usage", lambda path: Usage(1 << 40, 1 << 40, 12_000_000))
    answer = client.get("/readyz")
    assert (answer.status_code, answer.json()["title"]) == (507, "Disk is nearly full")
    assert "12 MB left" in answer.json()["detail"]
    assert client.head("/readyz").status_code == 507
    monkeypatch.setattr("shutil.disk_usage", lambda path: Usage(1 << 40, 0, 1 << 40))
    assert client.get("/readyz").status_code == 200
    assert client.head("/readyz").status_code == client.head("/livez").status_code == 200
    said = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
    assert len(said) == 2
    assert "12 MB left" in said[0]
    assert "enough space again" in said[1]


def test_render_that_may_fill_the_disk_is_rejected(
    client: TestClient, baked: Baked, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    request = {"bake": baked.bake, "view": "front", "looks": [{}], "format": "exr", "size": [16, 16]}
    monkeypatch.setattr("shutil.disk_usage", lambda path: Usage(1 << 40, 0, settings.min_free_bytes + 1_000_000))
    refused = client.post("/api/renders", json={**request, "frames": 100})
    assert (refused.status_code, refused.json()["title"]) == (507, "Disk is nearly full")
    assert "269 MB left, too little for up to 13 MB more" in refused.json()["detail"]
    assert client.post("/api/renders", json=request).status_code == 202
    assert client.get("/readyz").status_code == 200


def test_archive_of_a_batch_needs_the_space_of_its_frames(
    client: TestClient, baked: Baked, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings.min_free_bytes = 0
    monkeypatch.setattr("shutil.disk_usage", lambda path: Usage(1 << 40, 0, RESERVE_BYTES))
    request = {"bake": baked.bake, "view": "front", "looks": [{}], "format": "png"}
    url = client.post("/api/renders", json=request).headers["location"]
    while (body := client.get(url).json())["state"] not in ("ready", "failed"):
        time.sleep(0.01)
    assert (body["state"], "the files of a render cannot be written" in body["problem"]) == ("failed", True)
    assert client.get(f"{url}/frames/0").status_code == 200
    monkeypatch.setattr("shutil.disk_usage", lambda path: Usage(1 << 40, 0, 1 << 40))
    assert client.post(f"{url}/resume").status_code == 202
    while (body := client.get(url).json())["state"] != "ready":
        assert body["state"] != "failed", body
        time.sleep(0.01)
    assert client.get(f"{url}/archive.zip").status_code == 200


@pytest.mark.parametrize("path", ["renders", "comparisons", "materials/btf/jobs"])
def test_no_job_resumes_on_a_nearly_full_disk(client: TestClient, path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert client.post(f"/api/{path}/{'0' * 16}/resume").status_code == 404
    monkeypatch.setattr("shutil.disk_usage", lambda path: Usage(1 << 40, 1 << 40, 12_000_000))
    assert client.post(f"/api/{path}/{'0' * 16}/resume").status_code == 507


@pytest.mark.parametrize("error", [DiskFullError("a.webp"), OSError(errno.ENOSPC, "No space left on device")])
def test_full_disk_in_a_step_is_not_a_process_failure(error: Exception) -> None:
    problem = make_problem(error)
    with pytest.raises(DiskFullError, match=r"disk is full; free some space") as raised:
        _answer({"problem": problem.detail, "kind": problem.type.rpartition(":")[2]})
    assert make_problem(raised.value) == problem.model_copy(update={"title": "Disk is full"})


def test_health_checks_while_draining_are_not_logged(client: TestClient, caplog: pytest.LogCaptureFixture) -> None:
    client.app.state.drain.start()  # type: ignore[attr-defined]
    assert [client.get("/readyz").status_code for _ in range(2)] == [503, 503]
    assert [record for record in caplog.records if record.levelno >= logging.WARNING] == []


def test_import_process_distinguishes_a_full_disk_from_a_bad_file(
    settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: object) -> str:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    request = ImportRequest.create(settings, "built_in", None, "cornell_box")
    monkeypatch.setattr(import_request, "_import", full)
    assert run_import(request).keys() == {"full"}


@pytest.mark.parametrize(
    ("failure", "key"),
    [
        (RelumeError("of the program"), "failure"),
        (SceneError("empty"), "problem"),
        (MaterialError("of another size"), "material"),
        (OSError(errno.EFBIG, os.strerror(errno.EFBIG)), "large"),
        (OSError(errno.ENOMEM, os.strerror(errno.ENOMEM)), "problem"),
    ],
)
def test_import_process_distinguishes_service_errors_from_file_errors(
    settings: Settings, monkeypatch: pytest.MonkeyPatch, failure: Exception, key: str
) -> None:
    def fail(_: object) -> str:
        raise failure

    monkeypatch.setattr(import_request, "_import", fail)
    assert run_import(ImportRequest.create(settings, "built_in", None, "cornell_box")).keys() == {key}


def test_import_that_cannot_be_listed_fails_with_a_reason_and_leaves_no_files(
    client: TestClient, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise make_unavailable_error("refused")

    monkeypatch.setattr("relume_server.io.import_queue.insert_scene", fail)
    monkeypatch.setattr(client.app.state.services.import_queue.importers, "run", write_tiny_scene)  # type: ignore[attr-defined]
    refused = client.post("/api/scenes", files={"scene": ("triangle.glb", b"which nobody reads")})
    assert refused.status_code == 503
    assert client.get("/api/scenes").json() == []
    assert list((settings.data / "scenes").iterdir()) == []
