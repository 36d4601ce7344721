"""BTF jobs over REST: compression and import, invalid files, stop and resume."""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from btf_containers import container
from btf_zips import zipped
from fastapi.testclient import TestClient
from server_fakes import Control

from relume.assets.btf.compressed_view import ViewArrays
from relume.assets.btf.import_btf import import_btf
from relume.core.errors import CancelledError
from relume_server.settings import Settings

WORKS = "/api/materials/btf/jobs"
WAIT_S = 60.0


def wait_for(client: TestClient, url: str, *states: str) -> dict[str, Any]:
    deadline = time.monotonic() + WAIT_S
    while time.monotonic() < deadline:
        body: dict[str, Any] = client.get(url).json()
        if body["state"] in states:
            return body
        time.sleep(0.02)
    raise TimeoutError(url)


def wait_until_gone(path: Path) -> None:
    """A job's files are deleted after its row says that it has ended."""
    deadline = time.monotonic() + WAIT_S
    while path.exists():
        assert time.monotonic() < deadline, path
        time.sleep(0.02)


def send(client: TestClient, path: Path, **form: Any) -> str:
    with path.open("rb") as file:
        answer = client.post(WORKS, files={"images": ("Felt.zip", file)}, data=form)
    assert answer.status_code == 202, answer.text
    return str(answer.headers["location"])


def test_images_become_a_library_material(client: TestClient, settings: Settings, tmp_path: Path) -> None:
    url = send(client, zipped(tmp_path / "a.zip"), error=0.02)
    body = wait_for(client, url, "ready", "failed")
    assert (body["state"], body["name"], body["geometry"], body["problem"]) == ("ready", "Felt", None, None)
    (listed,) = client.get("/api/materials/btf").json()
    assert (listed["id"], listed["name"], listed["synthetic"]) == (body["material"], "Felt", None)
    assert listed["error"][-1] <= 0.02
    wait_until_gone(settings.data / "btf-jobs" / body["id"] / "images.zip")
    assert [work["id"] for work in client.get(WORKS).json()] == [body["id"]]
    assert client.delete(f"{url}?delete_files=true").status_code == 204
    assert client.get(url).status_code == 404
    assert client.get(WORKS).json() == []
    assert not (settings.data / "btf-jobs" / body["id"]).exists()
    assert len(client.get("/api/materials/btf").json()) == 1


def test_container_is_recognized_under_any_name(client: TestClient, settings: Settings, tmp_path: Path) -> None:
    path, _ = container(tmp_path / "a.btf")
    body = wait_for(client, send(client, path, error=0.02), "ready", "failed")
    assert (body["state"], body["problem"]) == ("ready", None)
    (listed,) = client.get("/api/materials/btf").json()
    assert (listed["id"], listed["directions"], listed["size"]) == (body["material"], 10, [6, 5])
    path.write_bytes(path.read_bytes()[:2000])
    body = wait_for(client, send(client, path), "ready", "failed")
    assert "truncated" in body["problem"]
    wait_until_gone(settings.data / "btf-jobs" / body["id"])


@pytest.mark.slow
def test_small_geometry_is_rendered(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_server.batch.btf_steps._GRID", 1)
    answer = client.post(f"{WORKS}/synthetic", json={"geometry": "corduroy", "size": 8, "error": 0.3})
    assert answer.status_code == 202
    body = wait_for(client, answer.headers["location"], "ready", "failed")
    assert (body["state"], body["name"], body["geometry"]) == ("ready", "Corduroy (synthetic)", "corduroy")
    assert client.get(f"/api/materials/btf/{body['material']}").json()["synthetic"] == "corduroy"


SQUARE = "v 0 0 0\nv 2 0 0\nv 2 0.1 -2\nv 0 0 -2\nf 1 2 3 4\n"


def test_uploaded_mesh_is_rendered_with_its_period(
    client: TestClient, settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def render(asset_store: Path, wanted: Any, name: str, *others: Any) -> Any:
        made.append((wanted.geometry, wanted.size, wanted.file.read_text(), wanted.period, name))
        return import_btf(asset_store, zipped(tmp_path / "b.zip"), name, 0.05, lambda share: None, lambda: False)

    made: list[Any] = []
    monkeypatch.setattr("relume_server.batch.btf_steps.synthesize_btf", render)
    form = {"size": 16, "period": 2.5}
    answer = client.post(f"{WORKS}/geometry", files={"geometry": ("Roof.obj", SQUARE)}, data=form)
    assert answer.status_code == 202
    body = wait_for(client, answer.headers["location"], "ready", "failed")
    assert (body["state"], body["geometry"], body["name"]) == ("ready", "mesh", "Roof (synthetic)")
    assert made == [("mesh", 16, SQUARE, 2.5, "Roof (synthetic)")]
    wait_until_gone(settings.data / "btf-jobs" / body["id"] / "images.zip")


@pytest.mark.parametrize(
    ("mesh", "form", "said"),
    [
        (SQUARE.replace("-2", "-3"), {}, "2 × 3 met"),
        (SQUARE, {"period": "nan"}, "finite"),
        (SQUARE, {"period": -1}, "more than 0"),
        (SQUARE, {"size": 10**9}, "256"),
    ],
)
def test_invalid_meshes_are_rejected_immediately(
    client: TestClient, settings: Settings, mesh: str, form: dict[str, Any], said: str
) -> None:
    answer = client.post(f"{WORKS}/geometry", files={"geometry": ("a.obj", mesh)}, data=form)
    assert answer.status_code == 422
    assert said in answer.text
    assert client.get(WORKS).json() == []
    assert not list(settings.data.glob("upload-*"))


def test_invalid_file_is_reported_and_the_next_job_runs(client: TestClient, tmp_path: Path) -> None:
    (tmp_path / "no.zip").write_bytes(b"no zip")
    body = wait_for(client, send(client, tmp_path / "no.zip"), "ready", "failed")
    assert (body["state"], body["material"]) == ("failed", None)
    assert "not a zip of images" in body["problem"]
    assert wait_for(client, send(client, zipped(tmp_path / "a.zip")), "ready", "failed")["state"] == "ready"


@pytest.mark.parametrize(
    "wanted",
    [{"geometry": "fur"}, {"geometry": "weave", "size": 4}, {"geometry": "weave", "size": 10**9},
     {"geometry": "weave", "error": 0}, {"geometry": "weave", "name": ""}, {}],
)  # fmt: skip
def test_invalid_requests_are_rejected(client: TestClient, wanted: dict[str, Any]) -> None:
    assert client.post(f"{WORKS}/synthetic", json=wanted).status_code == 422
    assert client.get(WORKS).json() == []


def test_stopped_job_keeps_partial_data_and_resumes(
    client: TestClient, control: Control, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    has_begun, has_ended, had_partial_data = threading.Event(), threading.Event(), []

    def slow(folder: Path, file: Path, name: str, bound: float, report: Callable[[float], object],
             is_canceled: Callable[[], bool], partial_path: Path, images: ViewArrays) -> Any:  # fmt: skip
        had_partial_data.append(partial_path.exists())
        if not has_begun.is_set():
            partial_path.mkdir()
            report(0.5)
            has_begun.set()
            while not is_canceled():
                time.sleep(0.01)
            has_ended.set()
            raise CancelledError("stopped")
        return import_btf(folder, file, name, bound, report, is_canceled, partial_path, images)

    monkeypatch.setattr("relume_server.batch.btf_steps.import_btf", slow)
    url = send(client, zipped(tmp_path / "a.zip"))
    assert has_begun.wait(WAIT_S)
    assert client.get(url).json()["progress"] == 0.5
    assert client.delete(url).status_code == 204
    assert client.get(url).json()["state"] == "canceled"
    assert has_ended.wait(WAIT_S)
    assert client.post(f"{url}/resume").status_code == 202
    assert wait_for(client, url, "ready", "failed")["state"] == "ready"
    assert had_partial_data == [False, True]


def test_jobs_take_turns_and_images_do_not_wait_for_geometry(
    client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relume_server.batch.btf_steps.SLICE_S", 0.0)
    done: list[float] = []

    def render(asset_store: Path, wanted: Any, name: str, report: Callable[[float], object],
               is_canceled: Callable[[], bool], partial_path: Path) -> Any:  # fmt: skip
        while not is_canceled():
            report(0.1 * len(done))
            done.append(0.1 * len(done))
            if len(done) == 7:
                return import_btf(
                    asset_store, zipped(tmp_path / "b.zip"), name, 0.05, lambda share: None, lambda: False
                )
            if len(done) == 3:
                images.append(send(client, zipped(tmp_path / "a.zip")))
        raise CancelledError("for now")

    images: list[str] = []
    monkeypatch.setattr("relume_server.batch.btf_steps.synthesize_btf", render)
    url = client.post(f"{WORKS}/synthetic", json={"geometry": "weave"}).headers["location"]
    assert wait_for(client, url, "ready", "failed")["state"] == "ready"
    assert len(done) == 7
    assert wait_for(client, images[0], "ready", "failed")["state"] == "ready"


def test_oversized_uploads_and_forms_are_rejected(client: TestClient, settings: Settings) -> None:
    large = b"0" * (settings.max_upload_bytes + 1)
    assert client.post(WORKS, files={"images": ("a.zip", large)}).status_code == 413
    assert client.post(WORKS, files={"images": ("a.zip", b"0")}, data={"error": 7}).status_code == 422
    assert client.get(WORKS).json() == []
