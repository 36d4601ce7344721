"""Viewers that send as fast as they can, each in a process of its own. Little is imported: starting them is no load."""

from __future__ import annotations

import json
import threading
import time
from contextlib import suppress
from multiprocessing.synchronize import Event

from websockets import Subprotocol
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

KINDS = ("acknowledgements", "exposure", "refused")
FIRST = 2000
"""Messages after which a viewer is about its worst."""
_REST_S = 0.5
SPEAKS = Subprotocol("relume.v1")


def flood(address: str, watch: str, kind: str, begun: Event) -> None:
    """Send as fast as can be, until killed; says when it is about it."""
    while True:
        with (
            suppress(WebSocketException, OSError),
            connect(address, subprotocols=[SPEAKS], max_size=None, compression=None) as viewer,
        ):
            viewer.send(json.dumps({"type": "open", "watch": watch}))
            threading.Thread(target=_read, args=(viewer,), daemon=True).start()
            for revision in range(1, 1_000_000_000):
                viewer.send(json.dumps(_message(kind, revision)))
                if revision == FIRST:
                    begun.set()
        time.sleep(_REST_S)  # else it would be a flood of connections


def _read(viewer: ClientConnection) -> None:
    with suppress(WebSocketException):
        for _ in viewer:
            pass


def _message(kind: str, revision: int) -> dict[str, object]:
    if kind == "acknowledgements":
        return {"type": "ack", "frame": 1}
    path = "/display/exposure" if kind == "exposure" else "/environment/rotation"
    patch = [{"op": "replace", "path": path, "value": revision % 7 / 10}]
    return {"type": "edit", "revision": revision, "patch": patch}
