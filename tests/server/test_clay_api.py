"""The clay picture of a scene over REST, before anything is baked."""

from __future__ import annotations

import io

import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image
from server_fakes import tiny_scene
from tiny_scenes import quad

from relume.assets.environments.environment import Environment
from relume.core.color import srgb_encode
from relume.output.clay import BACKGROUND
from relume.scene.model import Camera, Material
from relume.scene.scene_folder import make_scene
from relume.scene.shadow_catcher_ground import with_ground
from relume_worker.scenes import register_scene


def facing(name: str, distance: float, aspect: float | None) -> Camera:
    """A camera on the +Z axis whose image is as high as its distance."""
    to_world = np.eye(4)
    to_world[2, 3] = distance
    return Camera(name, to_world, 2 * np.arctan(0.5), aspect)


@pytest.fixture
def url(client: TestClient) -> str:
    """A wall of 2 m × 1 m with three cameras, in a scene without bakes."""
    wall = quad("wall", [[-1, -0.5, 0], [1, -0.5, 0], [1, 0.5, 0], [-1, 0.5, 0]], 0)
    cameras = [facing("near", 2, 2.0), facing("far", 4, None), facing("slit", 2, 1e6)]
    material = Material("White", ({"model": "lambert", "color": [1, 1, 1]},))
    scene = make_scene("Wall", [wall], [material], cameras, Environment("gray", np.ones((4, 8, 3), np.float32)))
    bakes = client.app.state.services.bakes  # type: ignore[attr-defined]
    return f"/api/scenes/{register_scene(bakes.data_dir, bakes.ledger, scene)}/clay.png"


def silhouette(client: TestClient, url: str) -> tuple[tuple[int, int], list[int]]:
    """Size of a picture, and the first and last column and row of its surfaces."""
    answer = client.get(url)
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "image/png"
    image = Image.open(io.BytesIO(answer.content))
    assert image.mode == "L"
    background = np.rint(255 * srgb_encode(np.array([BACKGROUND]))[0])
    rows, columns = np.nonzero(np.asarray(image) != background)
    return image.size, [columns.min(), columns.max(), rows.min(), rows.max()]


def test_first_camera_has_the_aspect_ratio_of_its_file(client: TestClient, url: str) -> None:
    assert silhouette(client, f"{url}?width=120") == ((120, 60), [30, 89, 15, 44])


def test_a_camera_and_a_size_are_chosen(client: TestClient, url: str) -> None:
    assert silhouette(client, f"{url}?camera=far&width=80&height=40") == ((80, 40), [30, 49, 15, 24])
    assert silhouette(client, f"{url}?camera=far&width=80")[0] == (80, 60)


def test_a_placed_camera_is_drawn_where_it_is_now(client: TestClient, url: str) -> None:
    frame = client.get(url.replace("clay.png", "cameras/near")).json()
    for distance, last_column in ((4.0, 49), (2.0, 59)):
        moved = [*frame["to_world"][:11], distance, *frame["to_world"][12:]]
        placed = {"to_world": moved, "yfov": frame["yfov"]}
        assert client.put(url.replace("clay.png", "cameras/Mine"), json=placed).status_code in (201, 204)
        assert silhouette(client, f"{url}?camera=Mine&width=80&height=40")[1][1] == last_column
    assert "no-cache" in client.get(f"{url}?camera=Mine").headers["cache-control"]


def test_an_extreme_aspect_ratio_has_a_bounded_size(client: TestClient, url: str) -> None:
    assert silhouette(client, f"{url}?camera=slit&width=1024")[0] == (1024, 16)


@pytest.mark.parametrize(
    "query",
    ["width=0", "width=15", "width=1025", "width=1e9", "width=-4", "width=64&height=100000", "size=4", "camera="],
)
def test_hostile_sizes_are_rejected(client: TestClient, url: str, query: str) -> None:
    assert client.get(f"{url}?{query}").status_code == 422


def test_missing_scenes_and_cameras_are_not_found(client: TestClient, url: str) -> None:
    answer = client.get(f"{url}?camera=behind")
    assert answer.status_code == 404
    assert "no camera 'behind'" in answer.json()["detail"]
    assert client.get(f"/api/scenes/{'0' * 16}/clay.png").status_code == 404


def test_a_scene_has_its_size_without_its_ground(client: TestClient, url: str) -> None:
    assert client.get(url.removesuffix("/clay.png")).json()["size"] == [2.0, 1.0, 0.0]
    bakes = client.app.state.services.bakes  # type: ignore[attr-defined]
    grounded = register_scene(bakes.data_dir, bakes.ledger, with_ground(tiny_scene()))
    assert client.get(f"/api/scenes/{grounded}").json()["size"] == [1.0, 1.0, 0.0]
