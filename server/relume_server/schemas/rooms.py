"""Messages between people who work on one look: who is here, and what the look has become."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from relume_server.schemas.message import Message, Name, Revision, RoleName

MAX_PERSON_NAME = 40
PersonName = Annotated[str, Field(min_length=1, max_length=MAX_PERSON_NAME)]
ROOM_PREFIX = 8
"""Characters of a room's name that stand in addresses, by which balancers choose a server; they open nothing."""
MIN_ROOM, MAX_ROOM = 24, 64
RoomName = Annotated[str, Field(min_length=MIN_ROOM, max_length=MAX_ROOM, pattern=r"^[A-Za-z0-9_-]+$")]


class PresenceMessage(Message):
    """client → server: what others in the room see of this one: the name, where nobody logs in (left out: as it was),
    and the selected material."""

    type: Literal["presence"]
    name: PersonName | None = None
    material: Name | None = None


class Person(Message):
    """Somebody in a room. `id`: theirs as long as they are in it. `online`: false while their connection is lost."""

    id: int
    name: str
    color: str
    material: str | None
    role: RoleName
    online: bool


class RoomInfo(Message):
    """The room of a session. `id` opens it to edit, null for who only watches; `view_token` opens it to watch.
    `participant_token` comes back as the same person, `self_id` is their id. `is_new`: nobody was in it, so that it has
    the look that this session brings. `default_look`: the scene's own look, as everything is that nobody has edited."""

    id: str | None
    view_token: str
    participant_token: str
    self_id: int
    is_new: bool
    people: list[Person]
    default_look: dict[str, Any]


class RoomMessage(Message):
    """server → client: who is in the room now, of these oneself at `self_id`."""

    type: Literal["room"] = "room"
    self_id: int
    people: list[Person]


class CommentsMessage(Message):
    """server → client: somebody has written, settled or deleted a comment on the scene; read the list again."""

    type: Literal["comments"] = "comments"


class SharedOperation(Message):
    """One operation of what a shared look has become. A path may be there already where it says `add`, and gone where
    it says `remove`."""

    op: Literal["replace", "add", "remove"]
    path: str
    value: Any = None


class RoomUpdate(Message):
    """server → client: what the room's look has become since the last such message, or `hello`, with this session's own
    edits up to `revision` in it. The `patch` is empty where there were no others. `room_revision` counts its changes,
    and frames say which they show. `edited_by`: ids of those who edited."""

    type: Literal["room_update"] = "room_update"
    revision: Revision
    room_revision: int
    patch: list[SharedOperation]
    edited_by: list[int]
