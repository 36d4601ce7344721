"""Sets: saved looks with their views, rendered in one batch."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from server_fakes import FakeTransfer, FakeView
from session_client import Baked
from test_batches import archive, displayed, error_of, sigma_look

from relume.core.errors import ParameterError
from relume.live.fixed_camera.protocols import CameraMode
from relume_server.batch.frame_sequence import cameras_of
from relume_server.batch.saved_views import use_saved_views
from relume_server.schemas.renders import QueuedRender

POSE = {"to_world": [1.0, 0, 0, 2, 0, 1, 0, 3, 0, 0, 1, 4, 0, 0, 0, 1], "yfov": 50.0, "near": 0.0}


def save(client: TestClient, name: str, sigma: float, view: dict[str, Any] | None) -> str:
    entry = client.put(f"/api/looks/{name}", json=sigma_look(sigma), headers={"If-None-Match": "*"}).json()
    if view is not None:
        answer = client.put(f"/api/looks/{name}/view", json=view, headers={"If-Match": entry["etag"]})
        assert answer.status_code == 204, answer.text
    return str(entry["etag"])


def test_a_look_keeps_its_view_when_it_is_saved_again(client: TestClient) -> None:
    etag = save(client, "Day", 0.3, {"view": "left", "camera": POSE})
    (entry,) = client.get("/api/looks").json()
    assert (entry["etag"], entry["view"]) == (etag, {"view": "left", "camera": POSE})
    client.put("/api/looks/Day", json={}, headers={"If-Match": etag})
    (entry,) = client.get("/api/looks").json()
    assert entry["view"] == {"view": "left", "camera": POSE}
    assert client.delete("/api/looks/Day/view", headers={"If-Match": etag}).status_code == 412
    assert client.delete("/api/looks/Day/view").status_code == 428
    assert client.delete("/api/looks/Day/view", headers={"If-Match": entry["etag"]}).status_code == 204
    assert client.get("/api/looks").json()[0]["view"] is None


@pytest.mark.parametrize("camera", [{**POSE, "yfov": 0.0}, {**POSE, "to_world": [0.0] * 16}, {**POSE, "to_world": []}])
def test_a_view_has_a_real_camera(client: TestClient, camera: dict[str, Any]) -> None:
    etag = save(client, "Day", 0.3, None)
    request = {"view": "left", "camera": camera}
    assert client.put("/api/looks/Day/view", json=request, headers={"If-Match": etag}).status_code == 422
    assert client.get("/api/looks").json()[0]["view"] is None


def test_all_sets_are_rendered_each_in_its_view(client: TestClient, baked: Baked) -> None:
    save(client, "Day", 0.3, {"view": "left"})
    save(client, "Night", 0.4, {"view": "front"})
    save(client, "Plain", 0.5, None)
    request: dict[str, Any] = {"bake": baked.bake, "view": "front", "looks": []}
    request |= {"saved_looks": ["Day", "Night", "Plain"], "saved_views": True}
    request |= {"format": "png", "file_name": "{view}_{look}.{frame:02}"}
    images = archive(client, request)
    assert list(images) == ["left_Day.00.png", "front_Night.01.png", "front_Plain.02.png"]
    for image, radiance in zip(images.values(), (0.8, 0.9, 1.0), strict=True):
        np.testing.assert_array_equal(image, displayed(radiance))
    body = client.get("/api/renders").json()[0]
    assert (body["total"], body["baking"]) == (3, None)
    assert "without one: 'Plain'" in error_of(client, request | {"view": None})
    assert "none with saved_views" in error_of(client, request | {"views": [{"view": "front"}]})
    assert "false for animations" in error_of(client, request | {"frames": 4})


def test_sets_with_other_views_or_free_cameras_are_named(client: TestClient, baked: Baked) -> None:
    save(client, "Top", 0.3, {"view": "top"})
    save(client, "Moved", 0.4, {"view": "front", "camera": POSE})
    request = {"bake": baked.bake, "view": "front", "looks": [], "format": "png", "saved_views": True}
    text = error_of(client, request | {"saved_looks": ["Top", "Moved"]})
    assert "views that the bake does not have ('Top: top'); give looks with a view of the bake: front, left" in text
    text = error_of(client, request | {"saved_looks": ["Moved"]})
    assert "looks with a free camera ('Moved'); give looks with a fixed camera, or a bake of method probes" in text


def test_a_free_camera_stands_where_each_look_was_saved() -> None:
    views = {name: FakeView(name, 8, 6) for name in ("front", "left")}
    transfer: Any = FakeTransfer("s", views, camera_mode=CameraMode.FREE)
    request = QueuedRender(bake="b" * 16, view="front", saved_looks=["Moved", "Still"], format="png", saved_views=True)
    request.looks, request.look_names = [{}, {}], ["Moved", "Still"]
    use_saved_views(request, [json.dumps({"view": "left", "camera": POSE}), None], transfer)
    assert [request.image(k) for k in range(2)] == [("b" * 16, "left", 0), ("b" * 16, "front", 1)]
    moved, still = cameras_of(request, "front", transfer)
    assert moved is not None
    assert still is not None
    np.testing.assert_allclose(moved.to_world[:3, 3], [2.0, 3.0, 4.0])
    np.testing.assert_allclose(np.degrees([moved.yfov, still.yfov]), [50.0, np.degrees(0.8)])
    np.testing.assert_array_equal(still.to_world, np.eye(4))


def test_missing_views_are_an_error_without_a_default() -> None:
    transfer: Any = FakeTransfer("s", {"front": FakeView("front", 8, 6)})
    request = QueuedRender(bake="b" * 16, saved_looks=["Still"], format="png", saved_views=True)
    request.looks, request.look_names = [{}], ["Still"]
    with pytest.raises(ParameterError, match="'Still'"):
        use_saved_views(request, [None], transfer)
