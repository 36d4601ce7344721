"""A data directory with a baked scene, a server process on it, and a client of its sessions."""

from __future__ import annotations

import json
import os
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from websockets import Subprotocol
from websockets.sync.client import ClientConnection, connect

from relume.core.errors import PlanError
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe
from relume_bench.workers import bake_s
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService
from relume_worker.status import bake_id

_START_S = 60.0
SPEAKS = Subprotocol("relume.v2")
OPENING = json.dumps({"type": "open"})


@dataclass(frozen=True)
class BakedFolder:
    """A data directory with one bake.

    Attributes:
        bake_s: seconds of the bake, including the start of worker processes.
    """

    data: Path
    scene: str
    bake: str
    bake_s: float


@contextmanager
def baked_folder(scene: Scene, recipe: Recipe) -> Iterator[BakedFolder]:
    """Bake a scene into a temporary data directory."""
    with tempfile.TemporaryDirectory() as folder:
        with BakeService(Path(folder)) as service:
            register_scene(service.data_dir, service.ledger, scene)
            taken_s = bake_s(service, scene.id, recipe)
        yield BakedFolder(Path(folder), scene.id, bake_id(scene.id, recipe), taken_s)


@dataclass(frozen=True)
class Server:
    """A running server process.

    Attributes:
        started_s: time of its start, by time.perf_counter.
        edits: file with the milliseconds of each edit.
    """

    port: int
    pid: int
    started_s: float
    edits: Path

    def session(self, bake: str) -> str:
        """WebSocket URL of sessions on a bake."""
        return f"ws://127.0.0.1:{self.port}/api/bakes/{bake}/session"

    def edit_ms(self) -> list[float]:
        """Times from receiving an edit to sending its frame, in order of frames."""
        return [json.loads(line) for line in self.edits.read_text().splitlines()]


@contextmanager
def serving(data_folder: BakedFolder, settings: Mapping[str, str] | None = None) -> Iterator[Server]:
    """Start the server; it accepts connections when this returns.

    Args:
        data_folder: to serve. settings: environment variables.
    """
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    edits = data_folder.data / "edits.txt"
    environment = {**os.environ, "RELUME_DATA": str(data_folder.data), "RELUME_PORT": str(port), **(settings or {})}
    start_time = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-m", "relume_bench.recording_server", str(edits)], env=environment)
    try:
        _wait(process, port)
        yield Server(port, process.pid, start_time, edits)
    finally:
        process.terminate()
        process.wait(60)  # it stops by itself after 30 s, whatever it does


def _wait(process: subprocess.Popen[bytes], port: int) -> None:
    for _ in range(int(_START_S / 0.02)):
        if process.poll() is not None:
            break
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1).close()
            return
        except OSError:
            time.sleep(0.02)
    raise PlanError("the server did not start; see its message above")


class SessionClient:
    """A live session that acknowledges every frame at once."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self._last: dict[str, Any] = {"exact": False, "revision": -1}

    def send_message(self, **message: Any) -> None:
        """Send a JSON message."""
        self._connection.send(json.dumps(message))

    def frame(self, timeout_s: float | None = None) -> tuple[dict[str, Any], int] | None:
        """Receive the header and the size of the next frame; None after the timeout. Raises PlanError on a problem."""
        while True:
            try:
                message = self._connection.recv(timeout_s)
            except TimeoutError:
                return None
            if isinstance(message, str):
                if json.loads(message)["type"] == "problem":
                    raise PlanError(f"the server refused: {message[:300]}")
                continue
            (length,) = struct.unpack_from("<I", message)
            header: dict[str, Any] = json.loads(message[4 : 4 + length])
            self.send_message(type="ack", frame=header["frame"])
            self._last = header
            return header, len(message)

    def exact(self, revision: int) -> None:
        """Wait for the exact frame of a revision."""
        while not (self._last["exact"] and self._last["revision"] >= revision):
            self.frame()


@contextmanager
def session(server: Server, bake: str) -> Iterator[SessionClient]:
    """Open a session on a bake."""
    with connect(server.session(bake), subprotocols=[SPEAKS], max_size=None, compression=None) as connection:
        connection.send(OPENING)
        yield SessionClient(connection)
