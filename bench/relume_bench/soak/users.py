"""Simulated users: each action repeats in a thread of its own."""

from __future__ import annotations

import json
import os
import random
import signal
import struct
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from websockets import Subprotocol
from websockets.sync.client import ClientConnection, connect

from relume_bench.soak.server import SoakServer

EDITS = 15
SPEAKS = Subprotocol("relume.v2")
DONE = ("ready", "failed", "canceled")


class Users:
    """All users, and the results of their actions.

    Attributes:
        counts: number of each action. failures: errors while no process had been killed.
    """

    def __init__(self, server: SoakServer, seed: int) -> None:
        self._server, self._seed = server, seed
        self.counts, self.failures = Counter[str](), list[str]()
        self._killed_s = -1e9
        self._stop, self._lock = threading.Event(), threading.Lock()
        persistent_scene, self._transient_scene = (entry["name"] for entry in server.call("/api/example-scenes")[:2])
        scene = server.call(f"/api/example-scenes/{persistent_scene}", {})["id"]
        self._bake, self._materials = self._baked(scene, 40), list[str]()
        self._threads = [
            threading.Thread(target=self._repeat, args=(act, k))
            for k, act in enumerate(
                (self._edit, self._edit, self._share, self._make_and_delete, self._render, self._kill)
            )
        ]

    def start(self) -> None:
        """Start."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Stop."""
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def _repeat(self, act: Callable[[random.Random], None], number: int) -> None:
        rng = random.Random(self._seed + number)
        while not self._stop.is_set():
            start_s = time.monotonic()
            try:
                act(rng)
            except Exception as error:
                self._note(act.__name__, start_s, f"{type(error).__name__}: {error}")
                self._stop.wait(0.5)
            else:
                self._count(act.__name__.lstrip("_"))

    def _count(self, event: str) -> None:
        with self._lock:
            self.counts[event] += 1

    def _note(self, action: str, start_s: float, reason: str) -> None:
        """Record an error; errors while a process is killed are expected, others are not."""
        is_caused_by_kill = self._killed_s >= start_s - 2.0
        self._count("ended by a killed process" if is_caused_by_kill else "failures")
        if not is_caused_by_kill and len(self.failures) < 20:
            self.failures.append(f"{action}: {reason[:300]}")

    def _edit(self, rng: random.Random) -> None:
        """Edit in a session alone: edits, a query, and a clean or unclean end."""
        with self._session(self._bake) as session:
            self._drag(session, rng)
            session.send(json.dumps({"type": "inspect", "x": 3, "y": 4}))
            _text(session, "inspect")
            if rng.random() < 0.3:
                session.socket.close()  # like a lost network

    def _share(self, rng: random.Random) -> None:
        """Edit with two participants in a room."""
        room = rng.randbytes(16).hex()
        with self._session(self._bake, room) as ann, self._session(self._bake, room) as bob:
            _text(bob, "hello")
            self._drag(ann, rng)
            _text(bob, "room_update")

    def _make_and_delete(self, rng: random.Random) -> None:
        """Import a scene, bake it, open it, and delete it."""
        call = self._server.call
        scene = call(f"/api/example-scenes/{self._transient_scene}", {})["id"]
        bake = self._baked(scene, rng.choice((60, 90, 120)), size=rng.choice((64, 128)))
        if not self._stop.is_set():
            with self._session(bake) as session:
                self._drag(session, rng)
        call(f"/api/scenes/{scene}", method="DELETE")

    def _render(self, rng: random.Random) -> None:
        """Render a batch, and delete it before or after it is finished."""
        call = self._server.call
        view = call(f"/api/bakes/{self._bake}")["recipe"]["views"][0]
        batch = {"bake": self._bake, "view": view, "looks": [{}] * 3, "format": "png"}
        identity = call("/api/renders", batch)["id"]
        is_patient = rng.random() < 0.7
        while is_patient and call(f"/api/renders/{identity}")["state"] not in DONE and not self._stop.is_set():
            time.sleep(0.2)
        call(f"/api/renders/{identity}", method="DELETE")

    def _kill(self, rng: random.Random) -> None:
        """Kill one of the server's child processes."""
        self._stop.wait(rng.uniform(10.0, 30.0))
        children = self._server.children()
        if children and not self._stop.is_set():
            self._killed_s = time.monotonic()
            with suppress(ProcessLookupError):
                os.kill(rng.choice(children), signal.SIGKILL)

    def _baked(self, scene: str, lights: int, size: int = 96) -> str:
        call = self._server.call
        bake = call("/api/bakes", {"scene": scene, "method": "direct", "size": [size, size], "lights": lights})
        while bake["state"] not in DONE and not self._stop.is_set():
            time.sleep(0.2)
            bake = call(f"/api/bakes/{bake['id']}")
        if bake["state"] != "ready" and not self._stop.is_set():
            raise RuntimeError(f"the bake is {bake['state']}: {bake['problem']}")
        return str(bake["id"])

    @contextmanager
    def _session(self, bake: str, room: str | None = None) -> Iterator[ClientConnection]:
        query = "" if room is None else f"?room_prefix={room[:8]}"
        url = f"ws://127.0.0.1:{self._server.port}/api/bakes/{bake}/session{query}"
        with connect(url, subprotocols=[SPEAKS], max_size=None, max_queue=None, proxy=None) as session:
            session.send(json.dumps({"type": "open", "room": room}))
            yield session

    @staticmethod
    def _drag(session: ClientConnection, rng: random.Random) -> None:
        """Edit a color several times, and wait for the last exact image."""
        hello = _text(session, "hello")
        first, revision = hello["materials"][0], hello["revision"]
        path = f"/materials/{first.replace('~', '~0').replace('/', '~1')}/terms/0/color"
        for _ in range(EDITS):
            revision += 1
            patch = [{"op": "replace", "path": path, "value": [round(rng.random(), 3) for _ in range(3)]}]
            session.send(json.dumps({"type": "edit", "revision": revision, "patch": patch}))
        while not ((frame := _frame(session))["exact"] and frame["revision"] >= revision):
            pass


def _receive(session: ClientConnection) -> dict[str, Any]:
    """Receive a message, or a frame's header; frames are acknowledged."""
    message = session.recv(timeout=60)
    if isinstance(message, str):
        content: dict[str, Any] = json.loads(message)
        return content
    (length,) = struct.unpack_from("<I", message)
    header: dict[str, Any] = json.loads(message[4 : 4 + length])
    session.send(json.dumps({"type": "ack", "frame": header["frame"]}))
    return {"type": "frame", **header}


def _text(session: ClientConnection, kind: str) -> dict[str, Any]:
    while (message := _receive(session))["type"] != kind:
        if message["type"] == "problem":
            raise RuntimeError(message["problem"]["detail"])
    return message


def _frame(session: ClientConnection) -> dict[str, Any]:
    return _text(session, "frame")
