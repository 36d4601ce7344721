"""scaling.*_frame_ms, scaling.*_mb, scaling.*_cpu_s: what one person, one bake and one render cost a real server.

One client drags a slider, a light and a free camera, each edit after the previous frame; the server's processor time ÷
frames, with all of its threads. Memory is resident memory of the server's process. A bake costs the processor time of
all processes that take part, their start included; a render that of the server and its worker processes, after the
first ones.
"""

from __future__ import annotations

import json
import os
import struct
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from websockets.sync.client import ClientConnection, connect

from relume.assets.environments.studio import studio
from relume.core.errors import PlanError
from relume.core.memory_usage import resident_bytes
from relume.scene.examples.cornell import cornell_box
from relume.store.bake_protocol import Recipe
from relume_bench.baked_server import OPENING, SPEAKS, BakedFolder, Server, baked_folder, serving
from relume_bench.figure import Figure
from relume_bench.scaling.ledgers import tree_cpu_s
from relume_bench.scenes import LAMBERT, cook_torrance, teapot_on_table

_SIGMA = "/materials/Teapot/terms/1/params/sigma"
_POINT_LIGHT: dict[str, Any] = {"kind": "point", "emission": [1.0, 1.0, 1.0], "position": [0.3, 0.5, 0.3]}
_WAIT_S = 120.0


@dataclass(frozen=True)
class _Workload:
    """Pixels, lights and probes of the bakes; seconds of a drag; sessions for the memory; frames of a batch."""

    size: tuple[int, int]
    lights: int
    probes: int
    seconds: float
    sessions: int
    renders: int


def measure(tiny: bool) -> list[Figure]:
    """Bake for a fixed and a free camera, serve, drag, open more sessions, render a batch."""
    sizes = _Workload((48, 32), 20, 300, 0.3, 2, 2) if tiny else _Workload((640, 480), 1000, 13_000, 4.0, 8, 8)
    glossy = (LAMBERT, cook_torrance(0.2))
    fixed = Recipe("direct", ("front",), sizes.size, sizes.lights)
    free = Recipe("probes", ("front",), sizes.size, sizes.lights, num_probes=sizes.probes)
    values: dict[str, tuple[float, str]] = {}
    spent_s = tree_cpu_s(os.getpid())
    with baked_folder(teapot_on_table(studio(), glossy, glossy), fixed) as data_folder:
        values["bake_cpu_s"] = tree_cpu_s(os.getpid()) - spent_s, "s"
        with serving(data_folder) as server:
            values |= _measure_memory(server, data_folder, sizes)
            with _session(server, data_folder.bake) as client:
                client.prepare(_SIGMA, sizes.seconds)
                slider, num_bytes = client.drag(_slider_edit, sizes.seconds)
                client.add_light()
                light, _ = client.drag(_light_edit, sizes.seconds)
            values["render_cpu_s"] = _render_cpu_s(server, data_folder, sizes.renders), "s"
    with (
        baked_folder(cornell_box(is_floor_glossy=True), free) as data_folder,
        serving(data_folder) as server,
        _session(server, data_folder.bake) as client,
    ):
        camera, _ = client.drag(client.camera_move(sizes.size), sizes.seconds)
    values |= {
        "slider_frame_ms": (slider, "ms"),
        "frame_kb": (num_bytes / 1000, "kB"),
        "light_frame_ms": (light, "ms"),
        "free_camera_frame_ms": (camera, "ms"),
    }
    names = "slider_frame_ms", "light_frame_ms", "free_camera_frame_ms", "frame_kb", "view_mb", "session_mb"
    context = {"size": list(sizes.size), "lights": sizes.lights, "probes": sizes.probes, "load": list(os.getloadavg())}
    return [Figure(f"scaling.{name}", *values[name], context) for name in (*names, "bake_cpu_s", "render_cpu_s")]


class _Client:
    """A session that acknowledges every frame.

    Args:
        connection: open. pid: of the server.
    """

    def __init__(self, connection: ClientConnection, pid: int) -> None:
        self._connection, self._pid, self._number = connection, pid, 0
        self._hello: dict[str, Any] = json.loads(connection.recv())

    def _frame(self, timeout_s: float = _WAIT_S) -> tuple[dict[str, Any], int]:
        while isinstance(message := self._connection.recv(timeout_s), str):
            if json.loads(message)["type"] == "problem":
                raise PlanError(f"the server refused: {message[:300]}")
        (length,) = struct.unpack_from("<I", message)
        header: dict[str, Any] = json.loads(message[4 : 4 + length])
        self._send_message({"type": "ack", "frame": header["frame"]})
        return header, len(message)

    def _send_message(self, message: dict[str, Any]) -> None:
        self._connection.send(json.dumps(message))

    def until_exact(self) -> None:
        """Wait for an exact frame of the last edit."""
        while not ((header := self._frame()[0])["exact"] and header["revision"] >= self._number):
            pass

    def add_light(self) -> None:
        """Add a local light to the look."""
        self._number += 1
        patch = [{"op": "add", "path": "/lights/Bulb", "value": _POINT_LIGHT}]
        self._send_message({"type": "edit", "revision": self._number, "patch": patch})
        self.until_exact()

    def prepare(self, parameter: str, seconds: float) -> None:
        """Announce a drag of a parameter, whose operator is computed in this time or a bit later."""
        self._send_message({"type": "prepare", "parameter": parameter})
        time.sleep(seconds)

    def camera_move(self, size: tuple[int, int]) -> Callable[[int], dict[str, Any]]:
        """Messages that move the free camera sideways."""
        view = self._hello["views"][0]
        camera = np.array(view["camera"]["to_world"]).reshape(4, 4)

        def move(number: int) -> dict[str, Any]:
            moved = camera.copy()
            moved[:3, 3] += camera[:3, 0] * 0.1 * np.sin(number / 10)
            message = {"type": "camera", "view": view["name"], "seq": number, "to_world": moved.ravel().tolist()}
            return {**message, "yfov": view["camera"]["yfov"], "size": list(size), "refine": "none"}

        return move

    def drag(self, message: Callable[[int], dict[str, Any]], seconds: float) -> tuple[float, float]:
        """Milliseconds of the server's processor time and bytes of each frame; a drag with a pause is done before, in
        which the server prepares what it needs once.
        """
        self._run(message, seconds)
        self._pause(seconds)
        self._run(message, seconds / 4)
        spent_s = tree_cpu_s(self._pid)
        num_frames, num_bytes = self._run(message, seconds)
        return 1e3 * (tree_cpu_s(self._pid) - spent_s) / num_frames, num_bytes / num_frames

    def _pause(self, seconds: float) -> None:
        """Receive and acknowledge frames for some time."""
        until_s = time.perf_counter() + seconds
        while time.perf_counter() < until_s:
            with suppress(TimeoutError):
                self._frame(max(0.01, until_s - time.perf_counter()))

    def _run(self, message: Callable[[int], dict[str, Any]], seconds: float) -> tuple[int, int]:
        until_s, num_frames, num_bytes = time.perf_counter() + seconds, 0, 0
        while time.perf_counter() < until_s or num_frames == 0:
            self._number += 1
            self._send_message(message(self._number))
            is_shown = False
            while not is_shown:
                header, size = self._frame()
                is_shown = max(header["revision"], header.get("camera_seq") or 0) >= self._number
                num_frames, num_bytes = num_frames + 1, num_bytes + size
        return num_frames, num_bytes


def _slider_edit(number: int) -> dict[str, Any]:
    sigma = round(0.2 + 0.15 * float(np.sin(2 * np.pi * number / 90)), 5)
    patch = [{"op": "replace", "path": _SIGMA, "value": sigma}]
    return {"type": "edit", "revision": number, "patch": patch, "active_control": _SIGMA}


def _light_edit(number: int) -> dict[str, Any]:
    x = round(0.3 * float(np.sin(2 * np.pi * number / 90)), 5)
    patch = [{"op": "replace", "path": "/lights/Bulb/position", "value": [x, 0.5, 0.3]}]
    return {"type": "edit", "revision": number, "patch": patch, "active_control": "/lights/Bulb"}


@contextmanager
def _session(server: Server, bake: str) -> Iterator[_Client]:
    """Open a session, and wait for its exact image."""
    with connect(server.session(bake), subprotocols=[SPEAKS], max_size=None, compression=None) as connection:
        connection.send(OPENING)
        client = _Client(connection, server.pid)
        if client._hello["views"][0]["camera_mode"] != "free":
            client.until_exact()
        yield client


def _measure_memory(server: Server, data_folder: BakedFolder, sizes: _Workload) -> dict[str, tuple[float, str]]:
    """Memory of an open view, with the results of its first image, and of each further session on it."""
    before = resident_bytes(server.pid)
    with _session(server, data_folder.bake):
        with_view = resident_bytes(server.pid)
        with _sessions(server, data_folder.bake, sizes.sessions):
            with_all = resident_bytes(server.pid)
    session_mb = max(0, with_all - with_view) / sizes.sessions / 1e6
    return {"view_mb": (max(0, with_view - before) / 1e6, "MB"), "session_mb": (session_mb, "MB")}


@contextmanager
def _sessions(server: Server, bake: str, number: int) -> Iterator[None]:
    if number == 0:
        yield
        return
    with _session(server, bake), _sessions(server, bake, number - 1):
        yield


def _render_cpu_s(server: Server, data_folder: BakedFolder, number: int) -> float:
    """Processor time of a render's image, by warm worker processes."""
    _render(server, data_folder, 2)
    spent_s = tree_cpu_s(server.pid)
    _render(server, data_folder, number)
    return (tree_cpu_s(server.pid) - spent_s) / number


def _render(server: Server, data_folder: BakedFolder, number: int) -> None:
    """Render a batch of looks that differ."""
    looks = [{"materials": {"Teapot": {"terms": [LAMBERT, cook_torrance(0.15 + 0.01 * k)]}}} for k in range(number)]
    body = {"bake": data_folder.bake, "view": "front", "looks": looks, "format": "png"}
    job, until_s = _call(server, "POST", "/api/renders", body), time.monotonic() + _WAIT_S
    while (state := _call(server, "GET", f"/api/renders/{job['id']}")["state"]) != "ready":
        if state == "failed" or time.monotonic() > until_s:
            raise PlanError(f"the render is {state}")
        time.sleep(0.1)


def _call(server: Server, method: str, path: str, body: Any = None) -> dict[str, Any]:
    request = urllib.request.Request(f"http://127.0.0.1:{server.port}{path}", method=method)
    if body is not None:
        request.data = json.dumps(body).encode()
        request.add_header("Content-Type", "application/json")
    with urllib.request.urlopen(request, timeout=_WAIT_S) as answer:
        content: dict[str, Any] = json.loads(answer.read())
    return content
