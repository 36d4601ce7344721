"""Cameras over REST: saved by name, and used by bakes by name or inline."""

import io
import time
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from PIL import Image
from tiny_scenes import still_life

from relume_server.app import create_app
from relume_server.settings import Settings
from relume_worker.scenes import register_scene


@pytest.fixture
def real_client(tmp_path: Path) -> Any:
    """The app with its real library."""
    settings = Settings(data=tmp_path / "data", client=tmp_path / "dist", allowed_hosts=["testserver"])
    with TestClient(create_app(settings)) as client:
        yield client


@pytest.fixture
def scene(real_client: TestClient) -> str:
    bakes = real_client.app.state.services.bakes  # type: ignore[attr-defined]
    return register_scene(bakes.data_dir, bakes.ledger, still_life())


def test_camera_is_saved_listed_baked_and_deleted(real_client: TestClient, scene: str) -> None:
    url = f"/api/scenes/{scene}/cameras"
    (front, *_) = real_client.get(url).json()
    assert (front["name"], front["is_placed"]) == ("front", False)
    frame = {"to_world": front["to_world"], "yfov": front["yfov"] / 2}
    frame["lens"] = {"radius": 0.01, "focus_distance": 1.2, "blades": 6}
    assert front["lens"] is None
    assert [real_client.put(f"{url}/Close up", json=frame).status_code for _ in range(2)] == [201, 204]
    saved = real_client.get(f"{url}/Close up").json()
    assert saved == {**frame, "near": 0.0, "name": "Close up", "is_placed": True}
    views = real_client.get(f"/api/scenes/{scene}").json()["views"]
    assert [view["name"] for view in views if view["is_placed"]] == ["Close up"]
    assert real_client.get("/api/scenes").json()[0]["views"] == views

    request = {"scene": scene, "method": "direct", "size": [32, 24], "lights": 50}
    by_name = real_client.post("/api/bakes", json=request | {"views": ["Close up"]})
    as_it_is = real_client.post("/api/bakes", json=request | {"views": [{"name": "Close up", **frame}]})
    assert by_name.status_code == 202, by_name.text
    assert by_name.json()["id"] == as_it_is.json()["id"]
    assert by_name.json()["recipe"]["cameras"] == [{"name": "Close up", **frame, "near": 0.0}]
    assert real_client.post("/api/bakes", json=request).json()["recipe"]["cameras"] == []
    bake = ready(real_client, by_name.headers["location"])
    assert real_client.get(f"/api/bakes/{bake}/views/Close up/materials.png").status_code == 200

    assert real_client.delete(f"{url}/Close up").status_code == 204
    assert real_client.get(f"{url}/Close up").status_code == 404
    assert real_client.get(f"/api/bakes/{bake}").json()["recipe"]["views"] == ["Close up"]


@pytest.mark.slow
def test_view_of_a_saved_camera_is_compared_with_its_reference(real_client: TestClient, scene: str) -> None:
    (front, *_) = real_client.get(f"/api/scenes/{scene}/cameras").json()
    moved = [*front["to_world"][:3], front["to_world"][3] + 0.3, *front["to_world"][4:]]
    placed = {"name": "Aside", "to_world": moved, "yfov": front["yfov"]}
    queued = real_client.post(
        "/api/bakes", json={"scene": scene, "method": "direct", "size": [32, 24], "lights": 50, "views": [placed]}
    )
    bake = ready(real_client, queued.headers["location"])
    asked = real_client.post("/api/comparisons", json={"bake": bake, "view": "Aside", "look": {}, "passes": 4})
    assert asked.status_code in (200, 202), asked.text
    url = asked.headers["location"]
    while (comparison := real_client.get(url).json())["state"] not in ("ready", "failed"):
        time.sleep(0.05)
    assert comparison["state"] == "ready", comparison["problem"]
    assert comparison["error_method_paths"]["rmse"] < 0.2


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"to_world": [0] * 16}, 422),
        ({"to_world": [1, 2]}, 422),
        ({"yfov": 180}, 422),
        ({"yfov": "wide"}, 422),
        ({"aspect": 2}, 422),
        ({"lens": {"radius": -1, "focus_distance": 1}}, 422),
        ({"lens": {"radius": 0.1}}, 422),
    ],
)
def test_invalid_camera_is_rejected_and_not_saved(
    real_client: TestClient, scene: str, change: dict[str, Any], status: int
) -> None:
    url = f"/api/scenes/{scene}/cameras"
    (front, *_) = before = real_client.get(url).json()
    frame = {"to_world": front["to_world"], "yfov": front["yfov"]} | change
    assert real_client.put(f"{url}/Hero", json=frame).status_code == status
    placed = {"name": "Hero", **frame}
    assert real_client.post("/api/bakes", json={"scene": scene, "views": [placed]}).status_code == status
    assert real_client.get(url).json() == before


def test_cameras_of_the_file_cannot_be_changed(real_client: TestClient, scene: str) -> None:
    url = f"/api/scenes/{scene}/cameras/front"
    front = real_client.get(url).json()
    assert real_client.put(url, json={"to_world": front["to_world"], "yfov": 20}).status_code == 422
    assert real_client.delete(url).status_code == 422
    assert real_client.get(url).json() == front
    assert real_client.get(f"/api/scenes/{'0' * 16}/cameras").status_code == 404


def ready(client: TestClient, url: str) -> str:
    """Wait for a bake and return its id."""
    while (bake := client.get(url).json())["state"] not in ("ready", "failed"):
        time.sleep(0.02)
    assert bake["state"] == "ready", bake["problem"]
    return str(bake["id"])


def test_viewport_shows_a_scene_before_any_bake(real_client: TestClient, scene: str) -> None:
    url = f"/api/scenes/{scene}/viewport"
    body = real_client.get(url).json()
    assert all(low < high for low, high in zip(body["bounds_min"], body["bounds_max"], strict=True))
    answer = real_client.post(url, json={**body["default_camera"], "size": [80, 60]})
    assert answer.headers["content-type"] == "image/jpeg"
    assert Image.open(io.BytesIO(answer.content)).size == (80, 60)
    pixel = {**body["default_camera"], "size": [80, 60], "x": 40, "y": 30}
    assert len(real_client.post(f"{url}/pick", json=pixel).json()["position"]) == 3
    away = [*body["default_camera"]["to_world"]]
    away[3], away[7], away[11] = 1e5, 1e5, 1e5
    assert real_client.post(f"{url}/pick", json=pixel | {"to_world": away, "x": 1, "y": 1}).json() == {"position": None}
    for wrong in ({"size": [1, 60]}, {"size": [80, 100_000]}, {"yfov": 0}, {"to_world": [0.0] * 16}):
        assert real_client.post(url, json={**body["default_camera"], "size": [80, 60]} | wrong).status_code == 422
    assert real_client.get(f"/api/scenes/{'0' * 16}/viewport").status_code == 404
