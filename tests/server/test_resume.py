"""A failed batch resumes: finished images remain and can be downloaded, and single images are rendered again."""

import io
import zipfile
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from problems import parse_problem
from session_client import Baked
from test_comparisons import is_done, wait_until

from relume.core.errors import RelumeError
from relume.image_io.write_image import write_image


class Painting:
    """Render all frames except one while `fails` is set; `painted` lists the rendered frames."""

    def __init__(self) -> None:
        self.fails = True
        self.painted: list[str] = []

    def write(self, path: Path, *picture: Any) -> None:
        if self.fails and path.stem == "0002":
            raise RelumeError("the process was killed; try again")
        write_image(path, *picture)
        self.painted.append(path.stem)


@pytest.fixture
def painting(monkeypatch: pytest.MonkeyPatch) -> Painting:
    new_painting = Painting()
    monkeypatch.setattr("relume_server.batch.frames.write_image", new_painting.write)
    return new_painting


@pytest.fixture
def failed(client: TestClient, baked: Baked, painting: Painting) -> str:
    """The address of a batch of four that failed at its third image."""
    request = {"bake": baked.bake, "view": "front", "looks": [{}] * 4, "format": "png", "name": "a"}
    url = client.post("/api/renders", json=request).headers["location"]
    assert wait_until(client, url, is_done)["state"] == "failed"
    return str(url)


def names_in(answer: Any) -> list[str]:
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
        return archive.namelist()


def test_failed_batch_resumes(client: TestClient, failed: str, painting: Painting) -> None:
    body = client.get(failed).json()
    assert (body["completed"], body["problem"]) == (2, "the process was killed; try again")
    assert body["ended"] is not None
    painting.fails = False
    resumed = client.post(f"{failed}/resume")
    assert resumed.status_code == 202
    assert (resumed.json()["problem"], resumed.json()["ended"]) == (None, None)
    assert wait_until(client, failed, is_done)["state"] == "ready"
    assert painting.painted == ["0000", "0001", "0002", "0003"]
    assert len(names_in(client.get(f"{failed}/archive.zip"))) == 4
    assert parse_problem(client.post(f"{failed}/resume"))["type"].endswith("not-ready")


def test_finished_images_of_a_batch_can_be_downloaded(client: TestClient, failed: str) -> None:
    refused = client.get(f"{failed}/archive.zip")
    assert refused.status_code == 409
    assert "?partial=true" in parse_problem(refused)["detail"]
    answer = client.get(f"{failed}/archive.zip?partial=true")
    assert answer.headers["content-type"] == "application/zip"
    assert answer.headers["content-disposition"].endswith("a-partial.zip")
    assert names_in(answer) == ["a-0000.png", "a-0001.png"]
    for frame in (0, 1):
        client.get(f"{failed}/frames/{frame}").raise_for_status()
    assert not list((client.app.state.services.settings.data / "renders").rglob("*.zip"))


def test_single_images_are_rendered_again(client: TestClient, failed: str, painting: Painting) -> None:
    painting.fails = False
    assert client.post(f"{failed}/frames/4/retry").status_code == 404
    assert client.post(f"{failed}/frames/1/retry").status_code == 202
    assert wait_until(client, failed, is_done)["state"] == "ready"
    assert painting.painted == ["0000", "0001", "0001", "0002", "0003"]
    etag = client.get(f"{failed}/archive.zip").headers["etag"]
    assert client.post(f"{failed}/frames/3/retry").json()["state"] in ("queued", "running")
    assert wait_until(client, failed, is_done)["state"] == "ready"
    assert painting.painted[-1] == "0003"
    assert client.get(f"{failed}/archive.zip").headers["etag"] != etag
    assert len(names_in(client.get(f"{failed}/archive.zip"))) == 4
