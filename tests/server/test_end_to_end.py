"""A real scene, bake and picture: the streamed picture equals a render of the same look."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import pytest
import trimesh
from fastapi.testclient import TestClient
from server_fakes import InThreadSteps
from session_client import Frame, open_session
from tiny_scenes import still_life

from relume.scene.shadow_catcher_ground import with_ground
from relume.store.bake_protocol import Recipe
from relume_server.app import create_app
from relume_server.settings import Settings
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService

WIDTH, HEIGHT = 80, 60


@pytest.fixture(scope="module")
def real_client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """The app with its real library; renders run in this process, not in worker processes that would have to start."""
    settings = Settings(data=tmp_path_factory.mktemp("data"), allowed_hosts=["testserver"])
    with TestClient(create_app(settings, open_steps=InThreadSteps)) as client:
        yield client


def decode_rgb9e5(payload: bytes) -> np.ndarray:
    """EXT_texture_shared_exponent, written out."""
    words = np.frombuffer(payload, "<u4")
    mantissas = np.stack([(words >> shift) & 0x1FF for shift in (0, 9, 18)], -1).astype(np.float64)
    return mantissas * np.exp2((words >> 27).astype(np.float64) - 15 - 9)[:, None]


def rendered_by(client: TestClient, request: dict[str, Any], folder: Path) -> np.ndarray:
    """Image of a batch render. (height, width, 3) float32"""
    url = client.post("/api/renders", json={**request, "format": "exr"}).headers["location"]
    assert wait_until_done(client, url)["state"] == "ready"
    file = folder / f"{request['view']}.exr"
    file.write_bytes(client.get(f"{url}/frames/0").content)
    pixels: np.ndarray = OpenImageIO.ImageBuf(str(file)).get_pixels(OpenImageIO.FLOAT)
    return pixels


def assert_same(picture: np.ndarray, rendered: np.ndarray) -> None:
    """Assert equality up to the nine-bit mantissas with a shared exponent."""
    tolerance = rendered.max(axis=-1, keepdims=True) / 256 + 1e-4
    assert rendered.max() > 0.01
    assert np.all(np.abs(picture - rendered) <= tolerance)


def put(picture: np.ndarray, frame: Frame) -> None:
    """Copy a frame's tiles into the client's picture."""
    pixels, start = decode_rgb9e5(frame.payload), 0
    for x, y, w, h in frame.header["tiles"]:
        picture[y : y + h, x : x + w] = pixels[start : start + w * h].reshape(h, w, 3)
        start += w * h


def wait_until_done(client: TestClient, url: str) -> dict[str, Any]:
    for _ in range(6000):
        body: dict[str, Any] = client.get(url).json()
        if body["state"] not in ("queued", "running"):
            return body
        time.sleep(0.02)
    raise TimeoutError(url)


def test_streamed_picture_equals_the_render(real_client: TestClient, tmp_path: Path) -> None:
    glb = trimesh.Scene(trimesh.creation.icosphere(subdivisions=3)).export(file_type="glb")
    scene = real_client.post("/api/scenes", files={"scene": ("ball.glb", glb)}).json()
    request: dict[str, Any] = {"scene": scene["id"], "method": "direct", "size": [WIDTH, HEIGHT], "lights": 200}
    bake = wait_until_done(real_client, real_client.post("/api/bakes", json=request).headers["location"])
    assert bake["state"] == "ready", bake["problem"]

    name = scene["materials"][0]["name"]
    terms = [
        {"model": "lambert", "color": [0.1, 0.3, 0.2]},
        {"model": "cook_torrance", "color": [1.0, 1.0, 1.0], "params": {"sigma": 0.3}},
    ]
    picture = np.zeros((HEIGHT, WIDTH, 3))
    with open_session(real_client, bake["id"]) as session:
        session.edit(1, f"/materials/{name}/terms", terms)
        session.send_message(type="prepare", curve=f"/materials/{name}/terms/1/curves/theta_h")
        session.edit(2, f"/materials/{name}/terms/1/params/sigma", 0.2)
        while True:
            message = session.receive()
            if isinstance(message, Frame):
                put(picture, message)
                if message.header["exact"] and message.header["revision"] == 2:
                    break
        session.send_message(type="inspect", x=WIDTH // 2, y=HEIGHT // 2)
        probe = session.text("inspect")

    terms[1]["params"] = {"sigma": 0.2}
    looks = [{"materials": {name: {"terms": terms}}}]
    assert_same(picture, rendered_by(real_client, {"bake": bake["id"], "view": "front", "looks": looks}, tmp_path))
    assert real_client.get(real_client.get(f"/api/scenes/{scene['id']}").json()["thumbnail"]).status_code == 200
    assert probe["material"] == name
    assert np.allclose(probe["radiance"], picture[HEIGHT // 2, WIDTH // 2], atol=0.01 * max(probe["radiance"]))


@pytest.mark.slow
def test_frame_matches_the_reference(real_client: TestClient) -> None:
    """The comparison over REST with the real reference measures the error of the bake, not its own noise."""
    glb = trimesh.Scene(trimesh.creation.icosphere(subdivisions=3)).export(file_type="glb")
    scene = real_client.post("/api/scenes", files={"scene": ("ball.glb", glb)}).json()
    bake_request: dict[str, Any] = {"scene": scene["id"], "method": "direct", "size": [32, 24], "lights": 1000}
    bake = wait_until_done(real_client, real_client.post("/api/bakes", json=bake_request).headers["location"])
    request = {"bake": bake["id"], "view": scene["views"][0]["name"], "passes": 8}
    comparison = wait_until_done(real_client, real_client.post("/api/comparisons", json=request).headers["location"])
    assert comparison["state"] == "ready", comparison["problem"]
    assert comparison["error_all_paths"]["noise"] > 0
    assert comparison["error_all_paths"]["error_upper_bound"] < 0.03  # of the error, which may be below the noise


def test_one_drag_changes_two_views_and_both_end_exact(real_client: TestClient, tmp_path: Path) -> None:
    bakes: BakeService = real_client.app.state.services.bakes  # type: ignore[attr-defined]
    scene = register_scene(bakes.data_dir, bakes.ledger, still_life())
    bake = bakes.submit(scene, Recipe("direct", ("front", "left"), (64, 48), 100))
    with bakes.subscribe(bake) as changes:
        assert list(changes)[-1].state == "ready"

    pictures = {name: np.zeros((48, 64, 3)) for name in ("front", "left")}
    last, frames = 6, []
    with open_session(real_client, bake) as session:
        session.send_message(type="views", names=["front", "left"])
        session.send_message(type="focus", view="left")
        session.send_message(type="prepare", curve="/materials/Ball/terms/1/curves/theta_h")
        for revision in range(1, last + 1):
            session.edit(revision, "/materials/Ball/terms/1/params/sigma", 0.1 + revision / 20)
        while {f.header["view"] for f in frames if f.header["exact"] and f.header["revision"] == last} != set(pictures):
            frame = session.frame()
            put(pictures[frame.header["view"]], frame)
            frames.append(frame)
        session.edit(last + 1, "/environment/intensity", 2.0)  # no freeze is needed: the focused view comes first
        followed = [session.exact(last + 1) for _ in range(2)]
    assert [frame.header["view"] for frame in followed] == ["left", "front"]

    params = {"sigma": 0.1 + last / 20}
    document = real_client.get(f"/api/scenes/{scene}").json()["materials"]
    terms = next(material["terms"] for material in document if material["name"] == "Ball")
    terms[1] = {**terms[1], "params": {**terms[1]["params"], **params}}
    for view, picture in pictures.items():
        request = {"bake": bake, "view": view, "looks": [{"materials": {"Ball": {"terms": terms}}}]}
        assert_same(picture, rendered_by(real_client, request, tmp_path))


def test_view_with_a_shadow_catcher_is_opened_again(real_client: TestClient) -> None:
    bakes: BakeService = real_client.app.state.services.bakes  # type: ignore[attr-defined]
    scene = with_ground(still_life())
    bake = bakes.submit(
        register_scene(bakes.data_dir, bakes.ledger, scene), Recipe("direct", ("front", "left"), (32, 24), 50)
    )
    with bakes.subscribe(bake) as changes:
        assert list(changes)[-1].state == "ready"
    ground = f"/materials/{scene.materials[-1].name}"
    terms = [{"model": "lambert"}, {"model": "cook_torrance"}]
    with open_session(real_client, bake) as session:
        session.edit(1, ground, {"shadow_catcher": False, "terms": terms})
        session.send_message(type="prepare", curve=f"{ground}/terms/1/curves/theta_h")
        session.exact(1)
        session.edit(2, f"{ground}/shadow_catcher", True)
        session.exact(2)
        session.send_message(type="view", name="left")
        assert session.exact(2).header["view"] == "left"


def test_slider_drag_shows_approximations_and_ends_exact(real_client: TestClient, tmp_path: Path) -> None:
    bakes: BakeService = real_client.app.state.services.bakes  # type: ignore[attr-defined]
    scene = register_scene(bakes.data_dir, bakes.ledger, still_life())
    bake = bakes.submit(scene, Recipe("direct", ("front",), (64, 48), 100))
    with bakes.subscribe(bake) as changes:
        assert list(changes)[-1].state == "ready"
    term, picture, frames = "/materials/Ball/terms/1", np.zeros((48, 64, 3)), []
    ggx = {"model": "ggx", "color": [0.8, 0.7, 0.6], "params": {"roughness": 0.5}}
    with open_session(real_client, bake) as session:
        session.edit(1, term, ggx)
        put(picture, session.exact(1))
        session.send_message(type="prepare", parameter=f"{term}/params/roughness")
        session.wait_until_ready("Ball, Roughness")
        session.edit(2, f"{term}/params/roughness", 0.3)
        while not frames or not frames[-1].header["exact"]:
            frame = session.frame()
            put(picture, frame)
            if frame.header["revision"] == 2:
                frames.append(frame)
    assert [frame.header["exact"] for frame in frames] == [False, True]
    ggx["params"] = {"roughness": 0.3}
    document = real_client.get(f"/api/scenes/{scene}").json()["materials"]
    first = next(material["terms"][0] for material in document if material["name"] == "Ball")
    looks = [{"materials": {"Ball": {"terms": [first, ggx]}}}]
    assert_same(picture, rendered_by(real_client, {"bake": bake, "view": "front", "looks": looks}, tmp_path))


def test_color_bleeding_follows_a_dragged_color_and_ends_exact(real_client: TestClient) -> None:
    bakes: BakeService = real_client.app.state.services.bakes  # type: ignore[attr-defined]
    scene = register_scene(bakes.data_dir, bakes.ledger, still_life())
    bake = bakes.submit(scene, Recipe("gather", ("front",), (64, 48), 100))
    with bakes.subscribe(bake) as changes:
        assert list(changes)[-1].state == "ready"
    color, picture = "/materials/Floor/terms/0/color", np.zeros((48, 64, 3))
    with open_session(real_client, bake) as session:
        session.edit(1, color, [0.1, 0.1, 0.8], control=color)  # transport rows are frozen for this color
        put(picture, session.exact(1))
        before = picture.copy()
        session.edit(2, color, [0.8, 0.1, 0.1], control=color)
        while (first := session.frame()).header["fidelity"] != "incremental":  # the last rows may still be missing
            put(picture, first)
        put(picture, first)
        followed = picture.copy()
        put(picture, session.exact(2))
    assert (first.header["revision"], first.header["exact"]) == (2, False)
    assert np.abs(followed - picture).mean() < 0.05 * np.abs(before - picture).mean()
