"""The server that the browser tests talk to."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, studio

from relume.scene.model import Light, Material, Scene
from relume_worker.database import open_database
from relume_worker.ledger import Ledger
from relume_worker.scenes import register_scene

SIZE = (320, 240)
START_S, BAKE_S = 240.0, 300.0


class Server:
    """`relume serve` as a process of its own; `kill` takes it away as a power cut would."""

    def __init__(self, data: Path) -> None:
        self.data = data
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port: int = probe.getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}"
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it and wait until it answers."""
        command = [sys.executable, "-m", "relume_cli.main", "serve", "--data", str(self.data), "--port", str(self.port)]
        with (self.data / "server.txt").open("ab") as log:
            environment = os.environ | {"RELUME_OCIO": "ocio://cg-config-latest"}
            self.process = subprocess.Popen(command, stdout=log, stderr=log, env=environment)
        deadline = time.monotonic() + START_S
        while True:
            try:
                return urllib.request.urlopen(f"{self.url}/readyz", timeout=2).close()
            except OSError:
                if time.monotonic() > deadline or self.process.poll() is not None:
                    pytest.fail(f"the server did not start: {(self.data / 'server.txt').read_text()}")
                time.sleep(0.1)

    def kill(self) -> None:
        """End it at once, without goodbyes."""
        assert self.process is not None
        self.process.kill()
        self.process.wait()

    def delete(self, path: str) -> None:
        """DELETE."""
        urllib.request.urlopen(urllib.request.Request(self.url + path, method="DELETE"), timeout=30).close()

    def create_free_camera_scene(self) -> str:
        """A scene of its own with one bake, whose view moves; it is to be deleted."""
        identity = str(self.call("/api/example-scenes/cornell_box", {})["id"])
        self.bake({"scene": identity, "method": "probes", "size": (120, 120), "lights": 100, "probes": 4000})
        return identity

    def ball_on_a_floor(self) -> str:
        """A metal one, and what it reflects, with one bake of few points whose view moves."""
        metal = {"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.4, "f0": 0.9}}
        clay = {"model": "lambert", "color": [0.8, 0.5, 0.3]}
        floor = quad("floor", [[-3, -2, 3], [3, -2, 3], [3, -2, -3], [-3, -2, -3]], 1)
        scene = make_tiny_scene(
            sphere("ball", [0, 0, 0], 1, 0, 24),
            floor,
            camera=make_camera("front", [0, 0.8, 3.2], [0, -0.2, 0], 0.75),
            environment=studio(),
            materials=[Material("Ball", (metal,)), Material("Floor", (clay,))],
        )
        return self._registered(scene)

    def panel_from_behind(self) -> str:
        """A floor and the back of a one-sided emissive panel, with one bake whose view moves."""
        clay = {"model": "lambert", "color": [0.8, 0.5, 0.3]}
        scene = make_tiny_scene(
            quad("panel", [[-1, 0.2, 0], [1, 0.2, 0], [1, 1.2, 0], [-1, 1.2, 0]], 0),
            quad("floor", [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]], 1),
            camera=make_camera("front", [0, 0.8, -3.2], [0, 0.5, 0], 0.75),
            environment=studio(),
            materials=[Material("Panel", (clay,), double_sided=False), Material("Floor", (clay,))],
            lights=[Light("Panel", {"kind": "mesh", "material": "Panel", "emission": [2.0, 4.0, 8.0]})],
        )
        return self._registered(scene)

    def _registered(self, scene: Scene) -> str:
        """Register a scene and bake it by few probes."""
        ledger = Ledger(open_database(f"sqlite:///{self.data / 'relume.db'}"))
        register_scene(self.data, ledger, scene)
        ledger.close()
        self.bake({"scene": scene.id, "method": "probes", "size": (120, 120), "lights": 100, "probes": 400})
        return scene.id

    def bake(self, recipe: dict[str, Any]) -> None:
        """Bake and wait until it is there."""
        bake = self.call("/api/bakes", recipe)
        deadline = time.monotonic() + BAKE_S
        while bake["state"] in ("queued", "running") and time.monotonic() < deadline:
            time.sleep(0.1)
            bake = self.call(f"/api/bakes/{bake['id']}")
        assert bake["state"] == "ready", bake["problem"]

    def call(self, path: str, body: dict[str, Any] | None = None) -> Any:
        """GET, or POST where there is a body."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.url + path, data, {"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=10) as answer:
            return json.load(answer)
