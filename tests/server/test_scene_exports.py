"""Exports of scenes over REST: the file, its report, saved looks, and errors."""

from __future__ import annotations

import errno
from typing import Any

import pytest
from fastapi.testclient import TestClient
from session_client import Baked

from relume.export.glb_buffer import GlbBuffer
from relume.scene_io.import_scene import import_scene

RED = {"materials": {"Paper": {"terms": [{"model": "lambert", "color": [0.8, 0.1, 0.1]}]}}}


@pytest.fixture
def url(client: TestClient, baked: Baked) -> str:
    return f"/api/scenes/{client.get(f'/api/bakes/{baked.bake}').json()['scene']}/exports"


def leftovers(client: TestClient) -> list[str]:
    data = client.app.state.services.settings.data  # type: ignore[attr-defined]
    return [path.name for path in data.glob("upload-*")]


def test_a_look_is_exported_and_nothing_stays(client: TestClient, url: str) -> None:
    answer = client.post(url, json={"look": RED})
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "model/gltf-binary"
    assert answer.headers["content-disposition"] == 'attachment; filename="triangle.glb"'
    (material,) = import_scene(answer.content, "again").materials
    assert material.terms[0]["color"] == pytest.approx([0.8, 0.1, 0.1])
    assert leftovers(client) == []


def test_saved_looks_are_exported_by_name(client: TestClient, url: str) -> None:
    assert client.put("/api/looks/Red", json=RED).status_code == 201
    request = {"saved_look": "Red", "variants": ["Red"]}
    scene = import_scene(client.post(url, json=request).content, "again")
    assert scene.materials[0].terms[0]["color"] == pytest.approx([0.8, 0.1, 0.1])
    assert scene.variants == {"Red": {"materials": {}}}
    assert client.post(url, json={"saved_look": "Blue"}).status_code == 404
    assert client.post(url, json={"saved_look": "Red", "look": RED}).status_code == 422


def test_the_report_precedes_the_file(client: TestClient, url: str) -> None:
    report = client.post(f"{url}/report", json={}).json()
    (paper,) = report["materials"]
    assert (paper["name"], paper["look"], paper["exact"]) == ("Paper", None, False)
    assert 0.05 < paper["error"] < 0.3
    assert report["omitted"] == ["The environment gray is not part of the file."]
    assert client.post(f"{url}/report", json={"look": RED}).json()["materials"][0]["exact"]


def test_a_light_mix_is_exported_and_one_given_as_look_says_what_is_missing(client: TestClient, url: str) -> None:
    mix = client.post(url, json={"format": "light_mix", "look": {"environment": {"intensity": 0.25}}})
    assert mix.headers["content-type"] == "application/json"
    assert mix.headers["content-disposition"] == 'attachment; filename="triangle.json"'
    assert (mix.json()["format"], mix.json()["environment"]["intensity"]) == ("relume light mix", 0.25)
    look = {**mix.json(), "lights": {"Key": {"intensity": 2.0}}}
    report = client.post(f"{url}/report", json={"format": "light_mix", "look": look}).json()
    assert report == {
        "materials": [],
        "omitted": ["The light mix has values for lights that the scene does not have: 'Key'."],
    }
    again = client.post(url, json={"format": "light_mix", "look": look}).json()
    assert again == mix.json()
    assert leftovers(client) == []


@pytest.mark.parametrize(
    ("request_body", "text"),
    [
        ({"look": {"materials": {"Teapot": {}}}}, "look is 'Teapot'; give a look of the scene"),
        ({"look": {"materials": {"Paper": {"terms": 3}}}}, "/materials/Paper/terms"),
        ({"format": "blend"}, "format"),
    ],
)
def test_bad_requests_are_refused(client: TestClient, url: str, request_body: dict[str, Any], text: str) -> None:
    for path in (url, f"{url}/report"):
        answer = client.post(path, json=request_body)
        assert answer.status_code == 422
        assert text in answer.text
    assert leftovers(client) == []


def test_a_full_disk_is_said_and_leaves_nothing(client: TestClient, url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: GlbBuffer, data: Any, **fields: Any) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(GlbBuffer, "add_view", fail)
    answer = client.post(url, json={})
    assert answer.status_code == 507, answer.text
    assert "the disk is full" in answer.text
    assert leftovers(client) == []
    assert client.post("/api/scenes/0123456789abcdef/exports", json={}).status_code == 404
