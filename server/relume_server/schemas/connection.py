"""Messages about the connection of a live session itself."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from relume_server.schemas.message import Message, Name
from relume_server.schemas.rooms import PersonName, RoomName

Token = Annotated[str, Field(min_length=1, max_length=64)]


class OpenMessage(Message):
    """client → server: first message, and sent once. All of it may be left out; null is the same.

    `room`, or to watch only `view_token`, names the room in which others share the look; the address then has the first
    eight characters of it as `room_prefix`. `participant_token`: this client's in that room. `name`: how to be
    called, where nobody logs in. `share`, or `look`: the shared or saved look to begin with. `resume`: token of a
    session that was lost."""

    type: Literal["open"]
    room: RoomName | None = None
    view_token: RoomName | None = None
    participant_token: Token | None = None
    name: PersonName | None = None
    share: Token | None = None
    look: Name | None = None
    resume: Token | None = None


class PingMessage(Message):
    """client → server: is anybody there? Answered by a `PongMessage` at once, whatever is being computed."""

    type: Literal["ping"]


class PongMessage(Message):
    """server → client: the answer to a `PingMessage`."""

    type: Literal["pong"] = "pong"


class DrainMessage(Message):
    """server → client: the server is being stopped. Open the session again, there or on another server, within so many
    seconds; until then it goes on. The look is the client's to bring, where the new server does not know the token."""

    type: Literal["server_draining"] = "server_draining"
    seconds: float
