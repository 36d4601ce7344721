"""Messages about the connection of a live session."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from relume_server.schemas.message import Message, Name
from relume_server.schemas.rooms import PersonName, RoomName

Token = Annotated[str, Field(min_length=1, max_length=64)]


class OpenMessage(Message):
    """client → server: first message, sent once. All fields are optional; null is the same as leaving them out.

    `room`, or `view_token` for a view-only link, is the id of the room to join; the URL then has its first eight
    characters as `room_prefix`. `participant_token`: of this client in the room. `name`: display name if the server has
    no login. `share`, or `look`: the shared or saved look to start with. `resume`: token of a lost session.
    """

    type: Literal["open"]
    room: RoomName | None = None
    view_token: RoomName | None = None
    participant_token: Token | None = None
    name: PersonName | None = None
    share: Token | None = None
    look: Name | None = None
    resume: Token | None = None


class PingMessage(Message):
    """client → server: keep-alive. Answered by a `PongMessage` at once, whatever is being computed."""

    type: Literal["ping"]


class PongMessage(Message):
    """server → client: answer to a `PingMessage`."""

    type: Literal["pong"] = "pong"


class DrainMessage(Message):
    """server → client: the server is stopping. Open the session again, here or on another server, within so many
    seconds; until then this one continues. Send the look if the new server does not know the resume token.
    """

    type: Literal["server_draining"] = "server_draining"
    seconds: float
