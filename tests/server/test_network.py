"""The server as uvicorn runs it, over a real socket."""

import json
import socket
import struct
import threading
import time
from collections.abc import Iterator

import pytest
import uvicorn
from server_fakes import SIZE, BatchesHere, Control, tiny_scene
from server_fixtures import open_fake_bakes
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from relume.bake import Recipe
from server.app import configure, create_app
from server.settings import Settings
from server.wire.protocol import MAX_MESSAGE_BYTES
from worker.scenes import register_scene


@pytest.fixture
def url(settings: Settings, control: Control) -> Iterator[str]:
    """Address of the session of a bake that is ready."""
    settings.allowed_hosts = ["127.0.0.1"]
    app = create_app(settings, open_library=control.open_library, open_batches=BatchesHere, open_bakes=open_fake_bakes)
    server = uvicorn.Server(configure(app, settings))
    with socket.create_server(("127.0.0.1", 0)) as listening:
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        while not server.started:
            time.sleep(0.01)
        bakes = app.state.services.bakes
        scene = register_scene(bakes.data_dir, bakes.ledger, tiny_scene())
        bake = bakes.submit(scene, Recipe("direct", ("front",), SIZE, 10))
        with bakes.subscribe(bake) as changes:
            assert list(changes)[-1].state == "ready"
        yield f"ws://127.0.0.1:{listening.getsockname()[1]}/api/bakes/{bake}/session"
        server.should_exit = True
        thread.join()


def open_socket(url: str) -> ClientConnection:
    return connect(url, subprotocols=["relume.v1"], max_size=None)


def test_session_runs_without_compression(url: str) -> None:
    with open_socket(url) as session:
        assert session.subprotocol == "relume.v1"
        assert session.protocol.extensions == []
        assert json.loads(session.recv())["type"] == "hello"
        frame = session.recv()
        assert isinstance(frame, bytes)
        (length,) = struct.unpack_from("<I", frame)
        assert json.loads(frame[4 : 4 + length])["frame"] == 1


def test_message_beyond_the_limit_closes_1009(url: str) -> None:
    with open_socket(url) as session:
        session.send("x" * (MAX_MESSAGE_BYTES + 1))
        with pytest.raises(ConnectionClosed) as closed:
            list(session)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1009


def test_page_of_another_site_is_refused_in_the_handshake(url: str) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        connect(url, subprotocols=["relume.v1"], origin="https://evil.example")
