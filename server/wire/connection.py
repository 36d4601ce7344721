"""Messages about the connection of a live session itself."""

from __future__ import annotations

from typing import Literal

from server.wire.message import Message


class PingMessage(Message):
    """client → server: is anybody there? Answered by a `PongMessage` at once, whatever is being computed."""

    type: Literal["ping"]


class PongMessage(Message):
    """server → client: the answer to a `PingMessage`."""

    type: Literal["pong"] = "pong"


class LeavingMessage(Message):
    """server → client: the server is being stopped. Open the session again, there or on another server, within so many
    seconds; until then it goes on. The look is the client's to bring, where the new server does not know the token."""

    type: Literal["leaving"] = "leaving"
    seconds: float
