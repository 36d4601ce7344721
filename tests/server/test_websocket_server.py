"""The server under uvicorn, over a real socket."""

import json
import logging
import socket
import struct
from collections.abc import Iterator

import pytest
from running_server import open_socket, running_server
from server_fakes import Control
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from relume_server.schemas.protocol import MAX_MESSAGE_BYTES
from relume_server.settings import Settings
from relume_server.telemetry.logs.setup import set_up


@pytest.fixture
def url(settings: Settings, control: Control) -> Iterator[str]:
    """Address of the session of a finished bake."""
    with running_server(settings, control) as running:
        yield running.baked_url()


def test_session_runs_without_compression(url: str) -> None:
    with open_socket(url) as session:
        assert session.subprotocol == "relume.v2"
        assert session.protocol.extensions == []
        assert json.loads(session.recv())["type"] == "hello"
        frame = session.recv()
        assert isinstance(frame, bytes)
        (length,) = struct.unpack_from("<I", frame)
        assert json.loads(frame[4 : 4 + length])["frame"] == 1


@pytest.mark.parametrize(
    ("headers", "status"),
    [({"Cookie": "a=" + "x" * 9000}, 431), ({f"X-{number}": "" for number in range(130)}, 431)],
)
def test_oversized_handshake_is_rejected_immediately(url: str, headers: dict[str, str], status: int) -> None:
    with pytest.raises(InvalidStatus, match=str(status)):
        connect(url, subprotocols=["relume.v2"], additional_headers=headers)


def test_invalid_request_is_rejected(url: str) -> None:
    host, _, path = url.removeprefix("ws://").partition("/")
    name, _, port = host.partition(":")
    sent = f"POST /{path} HTTP/1.1\r\nHost: {host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\r\n"
    with socket.create_connection((name, int(port)), timeout=30) as asking:
        asking.sendall(sent.encode())
        assert asking.recv(100).startswith(b"HTTP/1.1 4")


def test_message_beyond_the_limit_closes_1009(url: str) -> None:
    with open_socket(url) as session:
        session.send("x" * (MAX_MESSAGE_BYTES + 1))
        with pytest.raises(ConnectionClosed) as closed:
            list(session)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1009


def test_foreign_origin_is_rejected_in_the_handshake(
    url: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("handlers", "level"):
        monkeypatch.setattr(root := logging.getLogger(), name, getattr(root, name))  # restored after the test
    set_up("plain", "warning")
    with pytest.raises(InvalidStatus, match="403"):
        connect(url, subprotocols=["relume.v2"], origin="https://evil.example")
    with pytest.raises(InvalidStatus, match="403"):  # by then the first is logged
        connect(url, subprotocols=["relume.v2"], origin="https://evil.example")
    assert capsys.readouterr().err == ""
