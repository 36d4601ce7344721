"""Viewers that send as fast as the server reads, each in a process of its own, with little load of their own."""

from __future__ import annotations

import json
import struct
import threading
import time
from contextlib import suppress
from multiprocessing.synchronize import Event

from websockets import Subprotocol
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

FLOOD_TYPES = ("acknowledgements", "exposure", "refused")
SPEAKS = Subprotocol("relume.v2")
_AT_ONCE, _REST_S = 20_000, 0.5
_BEFORE_S = 2.0  # until the server has read the initial burst


def flood(address: str, watch: str, kind: str, started: Event) -> None:
    """Send as fast as possible, until killed.

    Args:
        address: address of the session. watch: view token of the room. kind: one of `FLOOD_TYPES`.
        started: set after a while of sending.
    """
    block = b"".join(_frame(_message(kind, revision)) for revision in range(1, _AT_ONCE))
    threading.Timer(_BEFORE_S, started.set).start()
    while True:
        with (
            suppress(WebSocketException, OSError),
            connect(address, subprotocols=[SPEAKS], max_size=None, compression=None, ping_interval=None) as viewer,
        ):
            viewer.send(json.dumps({"type": "open", "view_token": watch}))
            threading.Thread(target=_read, args=(viewer,), daemon=True).start()
            while True:
                viewer.socket.sendall(block)
        time.sleep(_REST_S)  # otherwise it would flood connections


def _read(viewer: ClientConnection) -> None:
    with suppress(WebSocketException):
        for _ in viewer:
            pass


def _frame(message: dict[str, object]) -> bytes:
    """Build a client's text frame (RFC 6455), masked with zeros."""
    payload = json.dumps(message).encode()
    length = struct.pack("!B", 128 + len(payload)) if len(payload) < 126 else struct.pack("!BH", 254, len(payload))
    return b"\x81" + length + bytes(4) + payload


def _message(kind: str, revision: int) -> dict[str, object]:
    if kind == "acknowledgements":
        return {"type": "ack", "frame": 1}
    path = "/display/exposure" if kind == "exposure" else "/environment/rotation"
    patch = [{"op": "replace", "path": path, "value": revision % 7 / 10}]
    return {"type": "edit", "revision": revision, "patch": patch}
