"""A client of live sessions for tests."""

import json
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from fastapi.testclient import TestClient

SIGMA = "/materials/Paper/terms/1/params/sigma"
IOR = "/materials/Paper/terms/1/params/ior"
THETA_H = "/materials/Paper/terms/1/curves/theta_h"
NO_FIELDS: Mapping[str, Any] = {}
THETA_D = "/materials/Paper/terms/1/curves/theta_d"


@dataclass(frozen=True)
class Baked:
    scene: str
    bake: str


@dataclass(frozen=True)
class Frame:
    header: dict[str, Any]
    payload: bytes


class Session:
    """Read messages by kind, and acknowledge frames unless `acknowledges` is false."""

    def __init__(self, websocket: Any, acknowledges: bool) -> None:
        self.websocket, self.acknowledges = websocket, acknowledges

    def send_message(self, **message: Any) -> None:
        self.websocket.send_text(json.dumps(message))

    def edit(self, revision: int, path: str, value: Any, op: str = "replace", control: str | None = None) -> None:
        self.send_message(
            type="edit", revision=revision, patch=[{"op": op, "path": path, "value": value}], active_control=control
        )

    def receive(self) -> dict[str, Any] | Frame:
        message = self.websocket.receive()
        if message["type"] == "websocket.close":
            raise ConnectionError(message["code"], message.get("reason", ""))
        if message.get("text") is not None:
            return json.loads(message["text"])
        data = message["bytes"]
        (length,) = struct.unpack_from("<I", data)
        frame = Frame(json.loads(data[4 : 4 + length]), data[4 + length :])
        if self.acknowledges:
            self.send_message(type="ack", frame=frame.header["frame"])
        return frame

    def text(self, kind: str) -> dict[str, Any]:
        while True:
            message = self.receive()
            if isinstance(message, dict) and message["type"] == kind:
                return message

    def wait_until_ready(self, label: str) -> None:
        """Wait until the precomputation with this label is ready; other jobs may end first."""
        while (status := self.text("status"))["state"] != "ready" or status["label"] != label:
            pass

    def frame(self) -> Frame:
        while True:
            message = self.receive()
            if isinstance(message, Frame):
                return message

    def exact(self, revision: int) -> Frame:
        while True:
            frame = self.frame()
            if frame.header["exact"] and frame.header["revision"] == revision and frame.header["kind"] == "picture":
                return frame


ROOM_FIELDS = {"room": "together-on-one-look-here"}
"""What opens a session in a room."""


@contextmanager
def open_session(
    client: TestClient, bake: str, *, acknowledges: bool = True, opening: Mapping[str, Any] = NO_FIELDS, **options: Any
) -> Iterator[Session]:
    """A session after its `opening` message with these fields."""
    options = {"subprotocols": ["relume.v2"], **options}
    with client.websocket_connect(session_path(bake, opening), **options) as websocket:
        session = Session(websocket, acknowledges)
        session.send_message(type="open", **opening)
        yield session


def session_path(bake: str, opening: Mapping[str, Any]) -> str:
    """The address of a session that will send these fields."""
    room = opening.get("room") or opening.get("view_token")
    return f"/api/bakes/{bake}/session" + ("" if room is None else f"?room_prefix={room[:8]}")
