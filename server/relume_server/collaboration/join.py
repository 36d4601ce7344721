"""How a session comes into a room, and the names that open one."""

from __future__ import annotations

import hashlib
import unicodedata
from dataclasses import dataclass

from relume.core.errors import ParameterError
from relume_server.schemas.connection import OpenMessage
from relume_server.schemas.rooms import MAX_PERSON_NAME, ROOM_PREFIX


@dataclass(frozen=True)
class JoinRequest:
    """What the first message of a session says of a room.

    Attributes:
        room: its id; None for who has only what opens it to watch.
        view_token: what opens it to watch; it follows from the id, and the id not from it.
        participant_token: token of the place that somebody had. name: how they are called.
    """

    room: str | None
    view_token: str
    participant_token: str | None
    name: str | None

    @property
    def prefix(self) -> str:
        """What of it stands in the address."""
        return self.view_token[:ROOM_PREFIX]


def parse_join_request(opening: OpenMessage, room_prefix: str) -> JoinRequest | None:
    """The door that a message names; None where it names none.

    Args:
        room_prefix: of the address.
    Raises:
        ParameterError: the name is not printable, or the address is one of other rooms.
    """
    name = None if opening.name is None else check_person(opening.name)
    if opening.room is not None:
        join_request = JoinRequest(opening.room, derive_view_token(opening.room), opening.participant_token, name)
    elif opening.view_token is not None:
        join_request = JoinRequest(None, opening.view_token, opening.participant_token, name)
    else:
        return None
    if room_prefix != join_request.prefix:
        allowed = f"{join_request.prefix}, as the room's name begins"
        raise ParameterError("room_prefix of the address", room_prefix[:80], allowed)
    return join_request


def derive_view_token(room: str) -> str:
    """What opens a room to watch: it begins as the room's name does, and the rest of the name nobody finds."""
    return room[:ROOM_PREFIX] + hashlib.sha256(b"relume watch " + room.encode()).hexdigest()[ROOM_PREFIX:32]


def check_person(name: str) -> str:
    """A name as others see it. Raises ParameterError unless it is printable and short."""
    name = unicodedata.normalize("NFC", name).strip()
    if not name.isprintable() or not 1 <= len(name) <= MAX_PERSON_NAME:
        raise ParameterError("name", name[:80], f"1 to {MAX_PERSON_NAME} printable characters")
    return name
