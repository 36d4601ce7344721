"""memory.*: resident memory of a real server and its worker processes, before ten scenes, after them, and when idle.

Each scene is baked, opened in a session, one of its curves is edited, its environment rotated and replaced, and the
session closed. `memory.server_growth`: growth of the idle server after forty more scenes, with small images: all
kernels are loaded after ten, and any later growth is a leak.
"""

from __future__ import annotations

import http.client
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from relume.assets.environments.studio import studio
from relume.core.errors import PlanError
from relume.scene.examples.catalog import BUILT_IN
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe
from relume_bench.baked_server import BakedFolder, Server, baked_folder, serving, session
from relume_bench.figure import Figure
from relume_bench.scenes import LAMBERT, cook_torrance, teapot_on_table
from relume_worker.database import open_database
from relume_worker.ledger import Ledger
from relume_worker.scenes import register_scene

_REST_S, _MORE_S = 60, 30  # idle time before the server releases memory, plus time to do it
_NUM_SCENES, _NUM_MORE = 10, 40


@dataclass(frozen=True)
class Resident:
    """Resident memory in bytes. workers: all child processes of the server."""

    server: int
    workers: int


def measure(tiny: bool) -> list[Figure]:
    """Let one server bake and show scene after scene, then leave it idle."""
    size, num_lights = ((64, 48), 60) if tiny else ((640, 480), 1000)
    num_scenes, num_more = (2, 1) if tiny else (_NUM_SCENES, _NUM_MORE)
    scenes = list(_make_scenes(num_scenes + num_more))
    with baked_folder(scenes[0], Recipe("direct", (scenes[0].cameras[0].name,), (64, 48), 60)) as data_folder:
        _register(data_folder, scenes[1:])
        with serving(data_folder) as server:
            before = _resident(server.pid)
            _use_all(server, scenes[:num_scenes], size, num_lights)
            after = _resident(server.pid)
            idle = _rested(server, tiny)
            _use_all(server, scenes[num_scenes:], (size[0] // 2, size[1] // 2), num_lights // 2)
            more = _rested(server, tiny)
    context = {
        "scenes": num_scenes,
        "size": list(size),
        "lights": num_lights,
        "idle_s": _REST_S + _MORE_S,
        "server_at_start": before.server / 1e6,
    }
    readings = {"after": after, "idle": idle}
    growth_context = {**context, "more_scenes": num_more, "floor_mb": idle.server / 1e6, "idle_mb": more.server / 1e6}
    return [
        *(
            Figure(f"memory.{process_group}_{when}_mb", getattr(resident, process_group) / 1e6, "MB", context)
            for when, resident in readings.items()
            for process_group in ("server", "workers")
        ),
        Figure("memory.server_growth", max(0.0, more.server / idle.server - 1), "share", growth_context),
    ]


def _make_scenes(count: int) -> Iterator[Scene]:
    """Generated scenes of several sizes, all different."""
    yield from [each.make() for each in BUILT_IN.values()][:count]
    for number in range(count - len(BUILT_IN)):
        yield teapot_on_table(studio(), (LAMBERT, cook_torrance(0.1 + 0.01 * number)), (LAMBERT,))


def _use_all(server: Server, scenes: list[Scene], size: tuple[int, int], num_lights: int) -> None:
    """Use one scene after another, every second with indirect light."""
    for number, scene in enumerate(scenes):
        _use_scene(server, scene, size, num_lights, "gather" if number % 2 else "direct")


def _rested(server: Server, tiny: bool) -> Resident:
    """Memory after some idle time."""
    time.sleep(0 if tiny else _REST_S + _MORE_S)
    return _resident(server.pid)


def _register(data_folder: BakedFolder, scenes: list[Scene]) -> None:
    ledger = Ledger(open_database(f"sqlite:///{data_folder.data / 'relume.db'}"))
    for scene in scenes:
        register_scene(data_folder.data, ledger, scene)
    ledger.close()


def _use_scene(server: Server, scene: Scene, size: tuple[int, int], num_lights: int, method: str) -> None:
    """Bake a scene, open it, edit it, and leave."""
    views = [scene.cameras[0].name]
    bake = _call(server, "POST", "/api/bakes", scene=scene.id, views=views, size=size, lights=num_lights, method=method)
    while bake["state"] in ("queued", "running"):
        time.sleep(0.2)
        bake = _call(server, "GET", f"/api/bakes/{bake['id']}")
    if bake["state"] != "ready":
        raise PlanError(f"the bake {bake['state']}: {bake['problem']}")
    material = scene.materials[0]
    curve = "theta_i" if material.terms[0]["model"] == "lambert" else "theta_h"
    light = [("/environment/rotation", 40.0), ("/environment/map", "sunset")]
    with session(server, bake["id"]) as client:
        client.exact(0)
        client.send_message(type="prepare", curve=f"/materials/{material.name}/terms/0/curves/{curve}")
        for revision, (path, value) in enumerate(light, start=1):
            client.send_message(type="edit", revision=revision, patch=[{"op": "replace", "path": path, "value": value}])
            client.exact(revision)


def _call(server: Server, verb: str, path: str, **body: Any) -> Any:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    headers = {"Content-Type": "application/json"} if body else {}
    connection.request(verb, path, json.dumps(body) if body else None, headers)
    answer = json.load(connection.getresponse())
    connection.close()
    return answer


def _resident(server: int) -> Resident:
    """Resident memory of a process, and of all its descendants."""
    parents = dict(_processes())
    below, num_bytes = {server}, 0
    while len(below) > num_bytes:
        num_bytes = len(below)
        below |= {pid for pid, parent in parents.items() if parent in below}
    return Resident(_resident_bytes(server), sum(_resident_bytes(pid) for pid in below - {server}))


def _processes() -> Iterator[tuple[int, int]]:
    """All processes with their parents."""
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            yield int(path.parent.name), int(path.read_text().rpartition(")")[2].split()[1])
        except OSError:  # it has ended
            continue


def _resident_bytes(pid: int) -> int:
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in status.splitlines() if line.startswith("VmRSS:")), 0)
