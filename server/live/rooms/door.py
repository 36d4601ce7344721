"""How a session comes into a room, and the names that open one."""

from __future__ import annotations

import hashlib
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass

from relume.errors import ParameterError
from server.wire.rooms import MAX_PERSON_NAME

MAX_ROOM = 64
PLACE, MIN_PLACED = 8, 24
"""Characters of a name by which balancers choose a server, and how long a name has to be to have such."""
_MAX_SEAT = 64
_ROOM = re.compile(rf"[A-Za-z0-9_-]{{1,{MAX_ROOM}}}")


@dataclass(frozen=True)
class Door:
    """What the address of a session says of a room.

    Attributes:
        room: its id; None for who has only what opens it to watch.
        watch: what opens it to watch; it follows from the id, and the id not from it.
        seat: token of the place that somebody had. name: how they are called.
    """

    room: str | None
    watch: str
    seat: str | None
    name: str | None


def door_of(asked: Mapping[str, str]) -> Door | None:
    """The door that a query names; None where it names none. Raises ParameterError."""
    room, watch, seat = asked.get("room"), asked.get("watch"), asked.get("seat")
    name = None if asked.get("name") is None else check_person(asked["name"])
    for field, value in (("room", room), ("watch", watch)):
        if value is not None and not _ROOM.fullmatch(value):
            raise ParameterError(field, value[:80], f"1 to {MAX_ROOM} letters, digits, hyphens and underscores")
    seat = None if seat is None else seat[:_MAX_SEAT]
    if room is not None:
        return Door(room, watch_of(room), seat, name)
    return None if watch is None else Door(None, watch, seat, name)


def watch_of(room: str) -> str:
    """What opens a room to watch.

    It begins as a long name does, so that a balancer sends both to one server; the rest of the name nobody finds, and
    of a short one nothing is shown.
    """
    hashed = hashlib.sha256(b"relume watch " + room.encode()).hexdigest()
    return (room[:PLACE] if len(room) >= MIN_PLACED else hashed[:PLACE]) + hashed[PLACE:32]


def check_person(name: str) -> str:
    """A name as others see it. Raises ParameterError unless it is printable and short."""
    name = unicodedata.normalize("NFC", name).strip()
    if not name.isprintable() or not 1 <= len(name) <= MAX_PERSON_NAME:
        raise ParameterError("name", name[:80], f"1 to {MAX_PERSON_NAME} printable characters")
    return name
