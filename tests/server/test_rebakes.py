"""Final renders: any size from a bake of another size, with names and cost told beforehand."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image
from server_fakes import SIZE, FakeMethod
from session_client import Baked
from test_batches import displayed, error_of, render, sigma_look
from test_comparisons import is_done, wait_until

from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe, StoreReader, Task, TaskOutput

LARGE = [240, 100]
GATE = threading.Event()  # methods are pickled


class GatedMethod(FakeMethod):
    """Its tasks wait for `GATE`."""

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: StoreReader) -> TaskOutput:
        GATE.wait(30)
        return super().compute(scene, recipe, task, store)


@pytest.fixture
def bakes(client: TestClient, baked: Baked, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The bake service; new bakes wait for `GATE`, which opens at the end."""
    service = client.app.state.services.bakes  # type: ignore[attr-defined]
    monkeypatch.setattr(service.kind, "method", lambda name: GatedMethod())
    GATE.clear()
    yield service
    GATE.set()


@pytest.fixture
def request_of(baked: Baked) -> dict[str, Any]:
    return {"bake": baked.bake, "view": "left", "looks": [sigma_look(0.3)], "format": "png"}


def test_a_dry_run_has_names_and_queues_nothing(client: TestClient, request_of: dict[str, Any]) -> None:
    request = request_of | {"looks": [{}] * 120, "file_name": "{view}.{frame:04}", "start_frame": 7, "dry_run": True}
    answer = client.post("/api/renders", json=request)
    plan = answer.json()
    assert answer.status_code == 200
    assert plan["file_names"] == [f"left.{k:04}.png" for k in range(7, 107)]
    assert (plan["total"], plan["bakes"], plan["warnings"]) == (120, [], [])
    assert plan["bytes"] > 120 * SIZE[0] * SIZE[1] * 3
    assert client.get("/api/renders").json() == []
    assert "/file_name" in error_of(client, request | {"file_name": "{nothing}"})


def test_another_size_is_baked_first_and_then_rendered(client: TestClient, request_of: dict[str, Any]) -> None:
    assert "rebake renders any size" in error_of(client, request_of | {"size": LARGE})
    request = request_of | {"size": LARGE, "rebake": True}
    (plan,) = client.post("/api/renders", json=request | {"dry_run": True}).json()["bakes"]
    assert (plan["recipe"]["size"], plan["recipe"]["views"]) == (LARGE, ["left"])
    assert plan["plan"]["view_samples"] == LARGE[0] * LARGE[1]
    assert [bake["id"] for bake in client.get("/api/bakes").json()] == [request_of["bake"]]
    done = render(client, request)
    assert (done["bake"], done["baking"]) == (plan["id"], None)
    image = np.array(Image.open(io.BytesIO(client.get(f"{done['url']}/frames/0").content)))
    np.testing.assert_array_equal(image, displayed(0.8, (LARGE[0], LARGE[1])))
    assert client.post("/api/renders", json=request | {"dry_run": True}).json()["bakes"] == []


def test_the_baked_size_is_not_baked_again(client: TestClient, request_of: dict[str, Any]) -> None:
    done = render(client, request_of | {"size": list(SIZE), "rebake": True})
    assert done["bake"] == request_of["bake"]
    assert "the size to bake" in error_of(client, request_of | {"rebake": True})


@pytest.mark.usefixtures("bakes")
def test_a_render_that_waits_for_its_bake_is_stopped_with_it(client: TestClient, request_of: dict[str, Any]) -> None:
    body = client.post("/api/renders", json=request_of | {"size": LARGE, "rebake": True}).json()
    running = wait_until(client, f"/api/renders/{body['id']}", lambda state: state["state"] == "running")
    assert (running["baking"], running["completed"]) == (0.0, 0)
    assert client.delete(f"/api/renders/{body['id']}").status_code == 204
    assert client.get(f"/api/bakes/{body['bake']}").json()["state"] == "canceled"


def test_a_render_whose_bake_was_canceled_fails_and_is_resumed_with_it(
    client: TestClient, request_of: dict[str, Any], bakes: Any
) -> None:
    body = client.post("/api/renders", json=request_of | {"size": LARGE, "rebake": True}).json()
    url = f"/api/renders/{body['id']}"
    wait_until(client, url, lambda state: state["state"] == "running")
    bakes.cancel(body["bake"])
    failed = wait_until(client, url, is_done)
    assert failed["problem"] == "the bake of these images is canceled; resume the render"
    GATE.set()
    assert client.post(f"{url}/resume").status_code == 202
    assert wait_until(client, url, is_done)["state"] == "ready"
