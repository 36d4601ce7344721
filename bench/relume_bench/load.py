"""load.drag_with_renders_ratio: frames per second of a dragged slider with full job queues ÷ without.

A real server in its own process, the image of `relume_bench.session`. A client drags σ and sends each edit after the
previous frame, and so gets all frames that the server can render. On the same session, alternating: alone, and while
batches of exact images and a comparison are queued and running; the ratio is of the medians.
"""

from __future__ import annotations

import json
import time
import urllib.request
from typing import Any

import numpy as np

from relume.assets.environments.studio import studio
from relume.store.bake_protocol import Recipe
from relume_bench.baked_server import BakedFolder, Server, SessionClient, baked_folder, serving, session
from relume_bench.figure import Figure
from relume_bench.scenes import LAMBERT, cook_torrance, teapot_on_table

_NAME = "load.drag_with_renders_ratio"
_SIGMA = "/materials/Teapot/terms/1/params/sigma"
_NUM_BATCHES = 8
_WAIT_S = 120.0


def measure(tiny: bool) -> list[Figure]:
    """Bake, serve, drag with the queues empty and full, alternating."""
    size, num_lights, rounds, seconds = ((64, 64), 60, 1, 0.5) if tiny else ((512, 512), 1000, 5, 3.0)
    scene = teapot_on_table(studio(), (LAMBERT, cook_torrance(0.2)), (LAMBERT,))
    with (
        baked_folder(scene, Recipe("direct", ("front",), size, num_lights)) as data_folder,
        serving(data_folder) as server,
        session(server, data_folder.bake) as client,
    ):
        client.send_message(type="prepare", curve="/materials/Teapot/terms/1/curves/theta_h")
        client.exact(0)
        slider_client = _SigmaClient(client)
        slider_client.drag(seconds)  # one-time work is done first
        unloaded_ms: list[float] = []
        loaded_ms: list[float] = []
        painted = 0
        for _ in range(rounds):
            unloaded_ms.append(slider_client.drag(seconds))
            queued = _fill(server, data_folder)
            loaded_ms.append(slider_client.drag(seconds))
            responses = [_call(server, "GET", address) for address in queued]
            painted += sum(int(body["completed"]) for body in responses)
            for address in queued:
                _call(server, "DELETE", f"{address}?delete_files=true" if "comparisons" in address else address)
            time.sleep(0.5)
    context = {
        "alone_fps": float(np.median(unloaded_ms)),
        "with_renders_fps": float(np.median(loaded_ms)),
        "each_ratio": [b / a for a, b in zip(unloaded_ms, loaded_ms, strict=True)],
        "steps_done": painted,
        "rounds": rounds,
        "seconds": seconds,
        "size": list(size),
    }
    return [Figure(_NAME, context["with_renders_fps"] / context["alone_fps"], "ratio", context)]  # type: ignore[operator]


class _SigmaClient:
    """Drags σ back and forth."""

    def __init__(self, client: SessionClient) -> None:
        self._client, self._revision = client, 0

    def drag(self, seconds: float) -> float:
        """Frames per second."""
        start_time, frames = time.perf_counter(), 0
        while (durations := time.perf_counter() - start_time) < seconds:
            self._revision += 1
            sigma = 0.2 + 0.15 * np.sin(2 * np.pi * self._revision / 90)
            patch = [{"op": "replace", "path": _SIGMA, "value": round(float(sigma), 5)}]
            self._client.send_message(type="edit", revision=self._revision, patch=patch)
            while (received := self._client.frame()) is None or received[0]["revision"] < self._revision:
                pass
            frames += 1
        self._client.exact(self._revision)
        return frames / durations


def _fill(server: Server, data_folder: BakedFolder) -> list[str]:
    """Queue batches and a comparison, and wait until the first runs; return their URLs."""
    common = {"bake": data_folder.bake, "view": "front"}
    looks = [{"materials": {"Teapot": {"terms": [LAMBERT, cook_torrance(0.15 + 0.002 * k)]}}} for k in range(200)]
    job_addresses = [
        str(_call(server, "POST", "/api/renders", {**common, "looks": looks, "format": "png"})["id"])
        for _ in range(_NUM_BATCHES)
    ]
    comparison_id = str(_call(server, "POST", "/api/comparisons", {**common, "passes": 1024})["id"])
    addresses = [*(f"/api/renders/{identity}" for identity in job_addresses), f"/api/comparisons/{comparison_id}"]
    deadline = time.monotonic() + _WAIT_S
    while not any(_call(server, "GET", address)["progress"] > 0 for address in addresses):
        if time.monotonic() > deadline:
            raise TimeoutError("the queue does not start")
        time.sleep(0.05)
    return addresses


def _call(server: Server, method: str, path: str, body: Any = None) -> dict[str, Any]:
    request = urllib.request.Request(f"http://127.0.0.1:{server.port}{path}", method=method)
    if body is not None:
        request.data = json.dumps(body).encode()
        request.add_header("Content-Type", "application/json")
    with urllib.request.urlopen(request, timeout=_WAIT_S) as answer:
        text = answer.read()
    content: dict[str, Any] = json.loads(text) if text else {}
    return content
