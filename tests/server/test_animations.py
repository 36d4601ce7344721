"""Animations: camera paths and turntables, interpolated looks, frames and videos."""

import math
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import pytest
from fastapi.testclient import TestClient
from PIL import Image
from shared_bakes import unmeasured
from test_end_to_end import wait_until_done
from test_free_camera_sessions import SIZE, bake, camera_message, client, scene

from relume.core.errors import RelumeError
from relume_server.io.video import write_video

__all__ = ["bake", "client", "scene", "unmeasured"]  # fixtures


@pytest.fixture
def material(client: TestClient, scene: dict[str, Any]) -> str:
    return str(scene["materials"][0]["name"])


def material_color(material: str, color: list[float]) -> dict[str, Any]:
    return {"materials": {material: {"terms": [{"model": "lambert", "color": color}]}}}


def frames_of(client: TestClient, request: dict[str, Any], folder: Path) -> list[np.ndarray]:
    """All images of a batch. (height, width, 3) float32 each"""
    answer = client.post("/api/renders", json={"view": "view", "looks": [{}], "format": "exr", **request})
    assert answer.status_code == 202, answer.text
    url = answer.headers["location"]
    done = wait_until_done(client, url)
    assert done["state"] == "ready", done["problem"]
    frames = []
    for index in range(done["total"]):
        file = folder / f"{index}.exr"
        file.write_bytes(client.get(f"{url}/frames/{index}").content)
        frames.append(OpenImageIO.ImageBuf(str(file)).get_pixels(OpenImageIO.FLOAT)[..., :3])
    return frames


@pytest.fixture(scope="module")
def view(client: TestClient, bake: str) -> dict[str, Any]:
    with client.websocket_connect(f"/api/bakes/{bake}/session", subprotocols=["relume.v2"]) as session:
        session.send_json({"type": "open"})
        first_view: dict[str, Any] = session.receive_json()["views"][0]
    return first_view


@pytest.mark.slow
def test_turntable_is_one_revolution_exact_or_interactive(
    client: TestClient, bake: str, view: dict[str, Any], tmp_path: Path
) -> None:
    request = {"bake": bake, "view": view["name"], "path": {"turntable": 3}, "size": [24, 18]}
    exact = frames_of(client, request, tmp_path)
    quick = frames_of(client, request | {"quality": "interactive"}, tmp_path)
    assert [frame.shape for frame in exact] == [(18, 24, 3)] * 3
    for k in range(3):
        assert np.abs(exact[k] - exact[k - 1]).max() > 0.05
        assert 0 < np.sqrt(np.mean((exact[k] - quick[k]) ** 2)) < 0.3 * np.sqrt(np.mean(exact[k] ** 2))
    (still,) = frames_of(client, request | {"path": None}, tmp_path)
    np.testing.assert_array_equal(exact[0], still)


@pytest.mark.slow
def test_turntable_rotates_the_object_or_the_environment(
    client: TestClient, scene: dict[str, Any], bake: str, view: dict[str, Any], tmp_path: Path
) -> None:
    light = {"kind": "point", "position": [2.0, 1.0, 2.0], "emission": [60.0, 30.0, 0.0]}
    asked = {"bake": bake, "view": view["name"], "quality": "interactive", "looks": [{"lights": {"Lamp": light}}]}
    frames_by_motion = {
        turns: frames_of(client, asked | {"path": {"turntable": 5, "rotate": turns}}, tmp_path)
        for turns in ("camera", "object", "environment")
    }
    first = frames_by_motion["camera"][0]
    of_frame = {
        turns: [np.sqrt(np.mean((frame - first) ** 2)) for frame in frames]
        for turns, frames in frames_by_motion.items()
    }
    assert max(frames[0] for frames in of_frame.values()) == 0
    assert max(of_frame["object"]) < 0.3 * min(
        of_frame["camera"][1:]
    )  # a ball looks the same from all sides, except for facets
    assert min(of_frame["environment"][1:]) > 3 * max(of_frame["object"])
    fixed = client.post(
        "/api/bakes", json={"scene": scene["id"], "method": "direct", "size": SIZE, "lights": 50}
    ).headers["location"]
    of_fixed = {"bake": wait_until_done(client, fixed)["id"], "view": scene["views"][0]["name"]}
    turned = frames_of(client, of_fixed | {"path": {"turntable": 3, "rotate": "environment"}}, tmp_path)
    look = {"environment": {"rotation": 120}}
    (expected,) = frames_of(client, of_fixed | {"looks": [look]}, tmp_path)
    np.testing.assert_array_equal(turned[1], expected)
    response = client.post(
        "/api/renders/looks", json=of_fixed | {"looks": [{}], "path": {"turntable": 3, "rotate": "environment"}}
    )
    assert [frame["environment"]["rotation"] for frame in response.json()["looks"]] == [0, 120, -120]
    assert response.json()["cameras"] is None


@pytest.mark.slow
def test_camera_path_interpolates_cameras_and_looks(
    client: TestClient, bake: str, view: dict[str, Any], material: str, tmp_path: Path
) -> None:
    cameras = []
    for aside in (0.0, 0.4):
        placed = camera_message(view, 1, aside)
        cameras.append({"to_world": placed["to_world"], "yfov": math.degrees(placed["yfov"])})
    looks = [material_color(material, [0.8, 0.0, 0.0]), material_color(material, [0.0, 0.0, 0.8])]
    request = {
        "bake": bake,
        "view": view["name"],
        "path": {"cameras": cameras},
        "looks": looks,
        "frames": 3,
        "quality": "interactive",
    }
    frames = frames_of(client, request, tmp_path)
    assert len(frames) == 3
    middle = [frame[SIZE[1] // 2, SIZE[0] // 2] for frame in frames]
    assert middle[0][0] > 0.01
    assert middle[0][2] < 1e-6
    assert middle[2][2] > 0.01
    assert middle[2][0] < 1e-6
    assert min(middle[1][0], middle[1][2]) > 0.003  # half red and half blue
    last = frames_of(client, request | {"path": {"cameras": cameras[1:]}, "looks": looks[1:], "frames": None}, tmp_path)
    np.testing.assert_array_equal(frames[2], last[0])


@pytest.mark.parametrize(
    "bad",
    [
        {"path": {"turntable": 0}},
        {"path": {"turntable": 1_000_000}},
        {"path": {"cameras": []}},
        {"path": {"turntable": 3}, "frames": 4},
        {"path": {"turntable": 3, "rotate": "moon"}},
        {"path": {"turntable": 3, "pivot": [0, 0]}},
        {"path": {"turntable": 3, "pivot": [0, 0, 1e10]}},
        {"path": {"cameras": [{"to_world": [0.0] * 16, "yfov": 40.0}]}},
        {"path": {"cameras": [{"to_world": [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], "yfov": 180.0}]}},
        {"frames": 0},
        {"frames": 1, "looks": [{}, {}]},
        {"frames": 4, "looks": [{}, {}], "durations": []},
        {"frames": 4, "looks": [{}, {}], "durations": [0.0]},
        {"frames": 4, "looks": [{}, {}], "durations": [1.0, 1.0]},
        {"fps": 0},
        {"size": [16000, 16000]},
    ],
    ids=str,
)
def test_invalid_paths_are_rejected_with_a_reason(
    client: TestClient, bake: str, view: dict[str, Any], bad: dict[str, Any]
) -> None:
    request = {"bake": bake, "view": view["name"], "looks": [{}], "format": "png"} | bad
    answer = client.post("/api/renders", json=request)
    assert answer.status_code == 422
    assert len(answer.json()["detail"]) > 10


def test_fixed_view_follows_looks_and_rejects_paths(
    client: TestClient, scene: dict[str, Any], material: str, tmp_path: Path
) -> None:
    request = {"scene": scene["id"], "method": "direct", "size": SIZE, "lights": 50}
    fixed = wait_until_done(client, client.post("/api/bakes", json=request).headers["location"])
    name = scene["views"][0]["name"]
    refused = client.post(
        "/api/renders",
        json={"bake": fixed["id"], "view": name, "looks": [{}], "format": "png", "path": {"turntable": 3}},
    )
    assert refused.status_code == 422
    assert "probes" in refused.json()["detail"]
    looks = [material_color(material, [0.8, 0.4, 0.0]), material_color(material, [0.0, 0.4, 0.8])]
    frames = frames_of(client, {"bake": fixed["id"], "view": name, "looks": looks, "frames": 3}, tmp_path)
    np.testing.assert_allclose(frames[1], (frames[0] + frames[2]) / 2, rtol=2e-3, atol=2e-3)


def test_video_needs_an_encoder(
    client: TestClient, bake: str, view: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    request = {
        "bake": bake, "view": view["name"], "looks": [{}], "format": "mp4", "path": {"turntable": 5}, "size": [33, 25],
        "quality": "interactive",
    }  # fmt: skip
    monkeypatch.setattr("shutil.which", lambda name: None)
    refused = client.post("/api/renders", json=request)
    assert refused.status_code == 422
    assert "ffmpeg" in refused.json()["detail"]
    monkeypatch.undo()
    if shutil.which("ffmpeg") is None:
        pytest.skip("ffmpeg is not installed: no video can be made")
    url = client.post("/api/renders", json=request).headers["location"]
    assert wait_until_done(client, url)["state"] == "ready"
    answer = client.get(f"{url}/video.mp4")
    assert answer.headers["content-type"] == "video/mp4"
    assert answer.content[4:8] == b"ftyp"
    assert len(client.get(f"{url}/frames/4").content) > 100


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed: no video can be made")
def test_video_keeps_frame_colors_and_declares_its_matrix(tmp_path: Path) -> None:
    frame_colors = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [200, 100, 50], [30, 180, 160]], np.uint8)
    for k in range(2):
        Image.fromarray(np.kron(frame_colors[None], np.ones((33, 33, 1), np.uint8))).save(tmp_path / f"{k:04d}.png")
    write_video(tmp_path, 25, tmp_path / "video.mp4", lambda: False)
    read = ["ffmpeg", "-loglevel", "info", "-i", str(tmp_path / "video.mp4"), "-frames:v", "1"]
    matrix = [
        "-vf",
        "scale=in_color_matrix=bt709:in_range=tv,format=rgb24",
    ]
    done = subprocess.run([*read, *matrix, str(tmp_path / "seen.png")], capture_output=True, text=True, check=True)
    assert "yuv420p(tv, bt709/bt709/iec61966-2-1" in done.stderr
    decoded = np.asarray(Image.open(tmp_path / "seen.png"))[16, 16::33][: len(frame_colors)]
    assert np.abs(decoded.astype(int) - frame_colors).max() <= 4


@pytest.mark.parametrize(
    ("does", "said"),
    [("kill -9 $$", "killed by signal 9"), ("exit 3", "ended with 3"), ("echo odd >&2; exit 1", "odd")],
)
def test_failed_encoder_is_reported_and_leaves_no_video(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, does: str, said: str
) -> None:
    program = tmp_path / "ffmpeg"
    program.write_text(f"#!/bin/sh\n{does}\n")
    program.chmod(0o755)
    monkeypatch.setattr("shutil.which", lambda name: str(program))
    with pytest.raises(RelumeError, match=rf"^ffmpeg could not make the video: .*{said}"):
        write_video(tmp_path, 25, tmp_path / "video.mp4", lambda: False)
    assert list(tmp_path.iterdir()) == [program]


def test_listed_looks_are_those_that_are_rendered(
    client: TestClient, bake: str, view: dict[str, Any], material: str, tmp_path: Path
) -> None:
    keys = {
        "bake": bake,
        "looks": [material_color(material, [0.8, 0.0, 0.0]), material_color(material, [0.0, 0.0, 0.8])],
        "frames": 5,
    }
    answer = client.post("/api/renders/looks", json=keys)
    assert answer.status_code == 200, answer.text
    looks = answer.json()["looks"]
    colors = [look["materials"][material]["terms"][0]["color"] for look in looks]
    np.testing.assert_allclose(colors, [[0.8 - 0.2 * k, 0, 0.2 * k] for k in range(5)], atol=1e-9)
    timed = client.post("/api/renders/looks", json={**keys, "looks": [*keys["looks"], {}], "durations": [3.0, 1.0]})
    timed_colors = [look["materials"][material]["terms"][0]["color"] for look in timed.json()["looks"]]
    np.testing.assert_allclose(timed_colors[:4], [[0.8 - 0.8 * k / 3, 0, 0.8 * k / 3] for k in range(4)], atol=1e-9)
    small = {"view": view["name"], "size": [20, 15], "quality": "interactive"}
    listed = frames_of(client, {"bake": bake, "looks": looks, **small}, tmp_path)
    rendered = frames_of(client, {**keys, **small}, tmp_path)
    for actual, expected in zip(listed, rendered, strict=True):
        np.testing.assert_array_equal(actual, expected)


@pytest.mark.slow
def test_listed_cameras_are_those_that_are_rendered(
    client: TestClient, bake: str, view: dict[str, Any], tmp_path: Path
) -> None:
    cameras = [
        {"to_world": placed["to_world"], "yfov": 40.0}
        for placed in (camera_message(view, 1, 0.0), camera_message(view, 1, 0.4))
    ]
    keys = {"bake": bake, "looks": [{}, {}], "frames": 3, "view": view["name"]}
    for path in ({"cameras": cameras}, {"turntable": 3, "start_camera": cameras[1]}):
        answer = client.post("/api/renders/looks", json={**keys, "path": path})
        assert answer.status_code == 200, answer.text
        listed = answer.json()["cameras"]
        assert len(listed) == 3
        small = {"bake": bake, "view": view["name"], "size": [20, 15], "quality": "interactive"}
        rendered = frames_of(client, {**small, "looks": [{}], "path": path, "frames": 3}, tmp_path)
        alone = frames_of(client, {**small, "looks": [{}, {}, {}], "path": {"cameras": listed}}, tmp_path)
        np.testing.assert_allclose(alone, rendered, atol=1e-5)
        assert np.abs(rendered[1] - rendered[0]).max() > 0.01


@pytest.mark.parametrize(
    ("fields", "word"),
    [
        ({"path": {"turntable": 3}}, "view"),
        ({"path": {"turntable": 4}, "view": "front", "frames": 3}, "turntable"),
        ({"path": {"turntable": 3}, "view": "nowhere"}, "view"),
        ({"frames": 601}, "frames"),
        ({"frames": 1}, "looks"),
        ({"looks": [{"materials": {"Nothing": {}}}]}, "/looks/0"),
        ({"interpolation": "magic"}, "interpolation"),
        ({"bake": "0" * 16}, "bake"),
    ],
)
def test_invalid_looks_of_frames_are_rejected_with_a_reason(
    client: TestClient, bake: str, fields: dict[str, Any], word: str
) -> None:
    answer = client.post("/api/renders/looks", json={"bake": bake, "looks": [{}, {}], "frames": 3, **fields})
    assert answer.status_code in (404, 422)
    assert word in answer.text
