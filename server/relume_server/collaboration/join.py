"""Joining a room: ids and tokens."""

from __future__ import annotations

import hashlib
import unicodedata
from dataclasses import dataclass

from relume.core.errors import ParameterError
from relume_server.schemas.connection import OpenMessage
from relume_server.schemas.rooms import MAX_PERSON_NAME, ROOM_PREFIX


@dataclass(frozen=True)
class JoinRequest:
    """Room in the first message of a session.

    Attributes:
        room: id; None for view-only clients.
        view_token: opens the room view-only; derived from the id, which cannot be derived from it.
        participant_token: participant token of an earlier session. name: display name.
    """

    room: str | None
    view_token: str
    participant_token: str | None
    name: str | None

    @property
    def prefix(self) -> str:
        """Room prefix, which is in the URL."""
        return self.view_token[:ROOM_PREFIX]


def parse_join_request(opening: OpenMessage, room_prefix: str) -> JoinRequest | None:
    """Parse the room of an `open` message; None if it has none.

    Args:
        opening: the message. room_prefix: room prefix in the URL.
    Raises:
        ParameterError: the name is not printable, or the URL has another prefix.
    """
    name = None if opening.name is None else check_person(opening.name)
    if opening.room is not None:
        join_request = JoinRequest(opening.room, derive_view_token(opening.room), opening.participant_token, name)
    elif opening.view_token is not None:
        join_request = JoinRequest(None, opening.view_token, opening.participant_token, name)
    else:
        return None
    if room_prefix != join_request.prefix:
        allowed = f"{join_request.prefix}, the first characters of the room's id"
        raise ParameterError("room_prefix of the address", room_prefix[:80], allowed)
    return join_request


def derive_view_token(room: str) -> str:
    """Derive the view token of a room: it has the same prefix, and does not reveal the rest of the id."""
    return room[:ROOM_PREFIX] + hashlib.sha256(b"relume watch " + room.encode()).hexdigest()[ROOM_PREFIX:32]


def check_person(name: str) -> str:
    """Check a display name. Raises ParameterError unless it is printable and short."""
    name = unicodedata.normalize("NFC", name).strip()
    if not name.isprintable() or not 1 <= len(name) <= MAX_PERSON_NAME:
        raise ParameterError("name", name[:80], f"1 to {MAX_PERSON_NAME} printable characters")
    return name
