"""Messages of a room: participants and changes of the shared look."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from relume_server.schemas.message import Message, Name, Revision, RoleName

MAX_PERSON_NAME = 40
PersonName = Annotated[str, Field(min_length=1, max_length=MAX_PERSON_NAME)]
ROOM_PREFIX = 8
"""Length of the room prefix in URLs, by which load balancers choose a server; it gives no access."""
MIN_ROOM, MAX_ROOM = 24, 64
RoomName = Annotated[str, Field(min_length=MIN_ROOM, max_length=MAX_ROOM, pattern=r"^[A-Za-z0-9_-]+$")]


class PresenceMessage(Message):
    """client → server: own name, if the server has no login (left out: unchanged), and selected material."""

    type: Literal["presence"]
    name: PersonName | None = None
    material: Name | None = None


class Person(Message):
    """A participant. `id`: constant while in the room. `online`: false while the connection is lost."""

    id: int
    name: str
    color: str
    material: str | None
    role: RoleName
    online: bool


class RoomInfo(Message):
    """The room of a session. `id` opens it for editing, null for view-only participants; `view_token` opens it
    view-only. `participant_token` rejoins as the same participant, `self_id` is its id. `is_new`: the room was empty,
    so it has the look of this session. `default_look`: the scene's default look.
    """

    id: str | None
    view_token: str
    participant_token: str
    self_id: int
    is_new: bool
    people: list[Person]
    default_look: dict[str, Any]


class RoomMessage(Message):
    """server → client: current participants; `self_id` is oneself."""

    type: Literal["room"] = "room"
    self_id: int
    people: list[Person]


class CommentsMessage(Message):
    """server → client: a comment of the scene was added, resolved or deleted; read the list again."""

    type: Literal["comments"] = "comments"


class SharedOperation(Message):
    """One operation of a change of the shared look. A path may already exist for `add`, or be missing for `remove`."""

    op: Literal["replace", "add", "remove"]
    path: str
    value: Any = None


class RoomUpdate(Message):
    """server → client: changes of the room's look since the last such message, or `hello`, including this session's own
    edits up to `revision`. The `patch` is empty if there were no others. `room_revision` counts the changes, and frames
    repeat it. `edited_by`: ids of the participants who edited.
    """

    type: Literal["room_update"] = "room_update"
    revision: Revision
    room_revision: int
    patch: list[SharedOperation]
    edited_by: list[int]
