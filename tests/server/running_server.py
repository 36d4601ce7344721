"""The server under uvicorn, in a thread, on a real socket."""

import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from fastapi import FastAPI
from server_fakes import SIZE, Control, InThreadSteps, tiny_scene
from server_fixtures import open_fake_bakes
from websockets import Subprotocol
from websockets.sync.client import ClientConnection, connect

from relume.store.bake_protocol import Recipe
from relume_server.app import create_app, create_server
from relume_server.lifecycle.server import ServerProcess
from relume_server.settings import Settings
from relume_worker.scenes import register_scene


@dataclass(frozen=True)
class Running:
    """A server, its thread and its port."""

    app: FastAPI
    process: ServerProcess
    thread: threading.Thread
    port: int

    def baked_url(self) -> str:
        """Address of the session of a finished bake."""
        return f"ws://127.0.0.1:{self.port}/api/bakes/{self.bake()}/session"

    def bake(self) -> str:
        """Id of a finished bake."""
        bakes = self.app.state.services.bakes
        scene = register_scene(bakes.data_dir, bakes.ledger, tiny_scene())
        bake = bakes.submit(scene, Recipe("direct", ("front",), SIZE, 10))
        with bakes.subscribe(bake) as changes:
            assert list(changes)[-1].state == "ready"
        return bake


@contextmanager
def open_socket(url: str, **opening: Any) -> Iterator[ClientConnection]:
    """A session after its `opening` message with these fields."""
    with connect(url, subprotocols=[Subprotocol("relume.v2")], max_size=None, proxy=None) as session:
        session.send(json.dumps({"type": "open", **opening}))
        yield session


@contextmanager
def running_server(settings: Settings, control: Control, port: int = 0) -> Iterator[Running]:
    settings.allowed_hosts = ["127.0.0.1"]
    app = create_app(settings, open_library=control.open_library, open_steps=InThreadSteps, open_bakes=open_fake_bakes)
    process = create_server(app, settings)
    with socket.create_server(("127.0.0.1", port)) as listening:
        thread = threading.Thread(target=process.run, kwargs={"sockets": [listening]})
        thread.start()
        while not process.started:
            time.sleep(0.01)
        try:
            yield Running(app, process, thread, listening.getsockname()[1])
        finally:
            process.should_exit = True
            thread.join()
