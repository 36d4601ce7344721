"""Batches for pipelines: names, numbers, saved looks, several views and bakes, contact sheets, light mixes."""

from __future__ import annotations

import errno
import io
import json
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image
from server_fakes import SIZE, Control
from session_client import Baked
from test_comparisons import is_done, wait_until

from relume.image_io.tone_mapping import tone_map
from relume.image_io.write_image import to_bytes
from relume.store.bake_protocol import Recipe


def sigma_look(sigma: float) -> dict[str, Any]:
    lambert = {"model": "lambert", "color": [0.5, 0.5, 0.5]}
    gloss = {"model": "cook_torrance", "color": [1.0, 1.0, 1.0], "params": {"sigma": sigma}}
    return {"materials": {"Paper": {"terms": [lambert, gloss]}}}


@pytest.fixture
def request_of(baked: Baked) -> dict[str, Any]:
    return {"bake": baked.bake, "view": "front", "looks": [{}], "format": "png"}


@pytest.fixture
def small_bake(client: TestClient, baked: Baked) -> str:
    """Another bake of the scene, 80 × 48."""
    bakes = client.app.state.services.bakes  # type: ignore[attr-defined]
    bake: str = bakes.submit(baked.scene, Recipe("direct", ("front",), (80, 48), 10))
    with bakes.subscribe(bake) as changes:
        assert list(changes)[-1].state == "ready"
    return bake


def render(client: TestClient, request: dict[str, Any]) -> dict[str, Any]:
    answer = client.post("/api/renders", json=request)
    assert answer.status_code == 202, answer.text
    url = answer.headers["location"]
    done = wait_until(client, url, is_done)
    assert done["state"] == "ready", done
    return {**done, "url": url}


def archive(client: TestClient, request: dict[str, Any]) -> dict[str, np.ndarray]:
    """Images of a render by their names."""
    url = render(client, request)["url"]
    with zipfile.ZipFile(io.BytesIO(client.get(f"{url}/archive.zip").content)) as files:
        return {name: np.array(Image.open(io.BytesIO(files.read(name)))) for name in files.namelist()}


def displayed(radiance: float, size: tuple[int, int] = SIZE) -> np.ndarray:
    return to_bytes(tone_map(np.full((size[1], size[0], 3), radiance, np.float32), 0.0, "agx"))


def error_of(client: TestClient, request: dict[str, Any]) -> str:
    answer = client.post("/api/renders", json=request)
    assert answer.status_code == 422, answer.text
    return str(answer.json()["detail"])


def test_files_are_named_by_a_template_with_frame_numbers(client: TestClient, request_of: dict[str, Any]) -> None:
    template = {"file_name": "{scene}_{view}_{look}.{frame:04}.png", "start_frame": 1001}
    looks = [sigma_look(0.3), sigma_look(0.4)]
    images = archive(client, request_of | template | {"looks": looks, "look_names": ["Day one"]})
    assert list(images) == ["triangle_front_Day-one.1001.png", "triangle_front_look-1.1002.png"]
    for image, radiance in zip(images.values(), (0.8, 0.9), strict=True):
        np.testing.assert_array_equal(image, displayed(radiance))


def test_a_step_renders_every_nth_frame_with_its_number(client: TestClient, request_of: dict[str, Any]) -> None:
    animation = {"looks": [sigma_look(0.3), sigma_look(0.7)], "frames": 5, "frame_step": 2, "start_frame": 10}
    template = {"file_name": "{look}.{frame}", "look_names": ["a", "b"]}
    images = archive(client, request_of | animation | template)
    assert list(images) == ["a-to-b.10.png", "a-to-b.12.png", "a-to-b.14.png"]
    for image, radiance in zip(images.values(), (0.8, 1.0, 1.2), strict=True):
        assert np.abs(image.astype(int) - displayed(radiance).astype(int)).max() <= 12  # logarithmic between keyframes
    np.testing.assert_array_equal(images["a-to-b.14.png"], displayed(1.2))
    assert "frame_step is 2" in error_of(client, request_of | {"frame_step": 2})


def test_saved_looks_are_rendered_as_they_were(
    client: TestClient, control: Control, request_of: dict[str, Any]
) -> None:
    for name, sigma in (("Red night", 0.3), ("Blue", 0.4)):
        assert client.put(f"/api/looks/{name}", json=sigma_look(sigma)).status_code == 201
    control.render_gate.clear()
    request = request_of | {"looks": [], "saved_looks": ["Red night", "Blue"], "file_name": "{look}"}
    url = client.post("/api/renders", json=request).headers["location"]
    client.put("/api/looks/Blue", json=sigma_look(0.9), headers={"If-Match": "*"})
    control.render_gate.set()
    assert wait_until(client, url, is_done)["state"] == "ready"
    assert [unquoted(client, url, index) for index in (0, 1)] == ["Red-night.png", "Blue.png"]
    np.testing.assert_array_equal(picture(client, url, 1), displayed(0.9))
    assert client.post("/api/renders", json=request | {"saved_looks": ["Green"]}).status_code == 404
    assert "1 to 1,000 looks" in error_of(client, request | {"saved_looks": []})


def unquoted(client: TestClient, url: str, index: int) -> str:
    return client.get(f"{url}/frames/{index}").headers["content-disposition"].split('"')[1]


def picture(client: TestClient, url: str, index: int) -> np.ndarray:
    return np.array(Image.open(io.BytesIO(client.get(f"{url}/frames/{index}").content)))


def test_several_views_and_bakes_are_one_render(
    client: TestClient, request_of: dict[str, Any], small_bake: str
) -> None:
    views = [{"view": "front"}, {"view": "left"}, {"view": "front", "bake": small_bake}]
    request = request_of | {"view": None, "views": views, "looks": [sigma_look(0.3), sigma_look(0.4)]}
    request |= {"look_names": ["a", "b"]}
    images = archive(client, request | {"file_name": "{bake}_{view}_{look}"})
    first = request_of["bake"]
    assert list(images) == [
        f"{bake}_{view}_{look}.png"
        for bake, view in ((first, "front"), (first, "left"), (small_bake, "front"))
        for look in "ab"
    ]
    for name, image in images.items():
        size = (80, 48) if name.startswith(small_bake) else SIZE
        np.testing.assert_array_equal(image, displayed(0.8 if name.endswith("a.png") else 0.9, size))
    names = list(archive(client, request))
    assert names[0] == f"triangle-{first}-front-0000.png"
    assert names[-1] == f"triangle-{small_bake}-front-0001.png"
    body = render(client, request | {"priority": 3})
    assert (body["total"], body["view"], len(body["views"]), body["priority"]) == (6, None, 3, 3)
    assert body["url"].endswith(client.get("/api/renders", params={"bake": small_bake}).json()[0]["id"])


def test_a_bake_that_is_deleted_fails_the_render_with_a_sentence(
    client: TestClient, control: Control, request_of: dict[str, Any], small_bake: str
) -> None:
    control.render_gate.clear()
    views = [{"view": "front"}, {"view": "front", "bake": small_bake}]
    url = client.post("/api/renders", json=request_of | {"view": None, "views": views}).headers["location"]
    wait_until(client, url, lambda body: body["progress"] > 0)
    assert client.delete(f"/api/bakes/{small_bake}?delete_files=true").status_code == 204
    control.render_gate.set()
    body = wait_until(client, url, is_done)
    assert (body["state"], body["completed"]) == ("failed", 1)
    assert "bake" in body["problem"]
    assert client.get(f"{url}/frames/0").status_code == 200
    assert client.get(f"{url}/archive.zip?partial=true").status_code == 200


def test_a_full_disk_leaves_no_half_file_and_the_rest_resumes(
    client: TestClient, request_of: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fill_disk(path: Path) -> None:
        path.write_bytes(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("relume.output.contact_sheet._arrange", lambda *_: SimpleNamespace(save=fill_disk))
    url = client.post("/api/renders", json=request_of | {"format": "contact_sheet"}).headers["location"]
    body = wait_until(client, url, is_done)
    assert body["state"] == "failed"
    assert "the disk is full" in body["problem"]
    assert client.get(f"{url}/contact-sheet.png").status_code == 409
    (folder,) = (client.app.state.services.settings.data / "renders").iterdir()  # type: ignore[attr-defined]
    assert {path.name for path in folder.iterdir()} == {"0000.png", "claim.txt"}
    monkeypatch.undo()
    assert client.post(f"{url}/resume").status_code == 202
    assert wait_until(client, url, is_done)["state"] == "ready"
    assert client.get(f"{url}/contact-sheet.png").status_code == 200


def test_contact_sheet_has_all_images_with_names(client: TestClient, request_of: dict[str, Any]) -> None:
    looks = [sigma_look(sigma) for sigma in (0.1, 0.2, 0.3)]
    body = render(client, request_of | {"looks": looks, "format": "contact_sheet", "name": "All looks"})
    answer = client.get(f"{body['url']}/contact-sheet.png")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png")
    assert 'filename="All-looks.png"' in answer.headers["content-disposition"]
    sheet = np.array(Image.open(io.BytesIO(answer.content)))
    assert sheet.shape == (2 * (96 + 24 + 12) + 12, 2 * (160 + 12) + 12, 3)
    np.testing.assert_array_equal(sheet[12 : 12 + 96, 12 : 12 + 160], displayed(0.6))
    np.testing.assert_array_equal(sheet[144 : 144 + 96, 12 : 12 + 160], displayed(0.8))
    with zipfile.ZipFile(io.BytesIO(client.get(f"{body['url']}/archive.zip").content)) as files:
        assert files.namelist()[3:] == ["contact-sheet-All-looks.png"]
        assert files.read(files.namelist()[3]) == answer.content
    other = render(client, request_of)["url"]
    assert client.get(f"{other}/contact-sheet.png").status_code == 404
    assert "at most 400 images" in error_of(client, request_of | {"format": "contact_sheet", "looks": [{}] * 401})


def test_a_light_mix_is_a_look_and_its_missing_names_are_said(client: TestClient, request_of: dict[str, Any]) -> None:
    mix = {"format": "relume light mix", "version": 1, "kinds": {"Key": "point"}, "lights": {"Key": {"intensity": 2.0}}}
    mix["environment"] = {"intensity": 0.5}
    body = render(client, request_of | {"looks": [mix, mix, {}], "file_name": "{frame}"})
    assert body["warnings"] == ["The light mix has values for lights that the scene does not have: 'Key'."]
    assert client.get(body["url"]).json()["warnings"] == body["warnings"]
    looks = client.post("/api/renders/looks", json={"bake": request_of["bake"], "looks": [mix]}).json()["looks"]
    assert (looks[0]["environment"]["intensity"], looks[0]["lights"]) == (0.5, {})


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"looks": [{}, {}], "file_name": "{view}"}, "images 0 and 1 would both be 'front.png'; give a name with"),
        ({"looks": [{}, {}], "look_names": ["a/b", "a?b"], "file_name": "{look}"}, "would both be 'a-b.png'"),
        ({"frames": 2, "looks": [{}, {}], "file_name": "{look}"}, "give a name with {frame}"),
        ({"file_name": "../{look}"}, "file_name is '../{look}"),
        ({"file_name": "{look}.exr"}, "a name that ends in .png"),
        ({"file_name": ""}, "file_name"),
        ({"file_name": "a" * 300}, "file_name"),
        ({"look_names": ["a", "b"]}, "look_names is a list of 2 names"),
        ({"frames": 10_000}, "frames"),
        ({"looks": [{"materials": {"Teapot": {}}}]}, "a material of this scene"),
        ({"view": None}, "either view, or a list of views"),
        ({"views": [{"view": "left"}]}, "either view, or a list of views"),
        ({"view": None, "views": [{"view": "back"}]}, "view is 'back'"),
        ({"view": None, "views": [{"view": "front"}] * 2}, "would both be"),
        ({"view": None, "views": [{"view": "front"}] * 65}, "views"),
        ({"view": None, "views": [{"view": "front"}, {"view": "left"}], "format": "mp4"}, "one view"),
        ({"view": None, "views": [{"view": "front"}, {"view": "left"}], "frames": 3600}, "at most 3,600"),
        ({"start_frame": -1}, "start_frame"),
        ({"frame_step": 0}, "frame_step"),
        ({"priority": 11}, "priority"),
        ({"webhook": "https://hooks.example.com/"}, "this server allows no hosts"),
    ],
)  # fmt: skip
def test_what_cannot_be_rendered_is_rejected_at_once(
    client: TestClient, request_of: dict[str, Any], change: dict[str, Any], text: str
) -> None:
    answer = client.post("/api/renders", json=request_of | change)
    assert answer.status_code == 422, answer.text
    assert text in json.loads(answer.text)["detail"]
    assert client.get("/api/renders").json() == []


def test_missing_bakes_and_large_sets_of_looks_are_rejected(client: TestClient, request_of: dict[str, Any]) -> None:
    views = [{"view": "front", "bake": "f" * 16}]
    assert client.post("/api/renders", json=request_of | {"view": None, "views": views}).status_code == 404
    large = {"materials": {"Paper": {"terms": [{"model": "lambert", "note": "x" * 200_000}]}}}
    assert client.put("/api/looks/Large", json=large).status_code == 201
    assert "fewer of them" in error_of(client, request_of | {"saved_looks": ["Large"] * 11})
