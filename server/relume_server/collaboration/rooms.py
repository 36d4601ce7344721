"""All rooms of this process. They live as long as somebody has a place in them, and in memory alone."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from relume_server.auth.roles import Caller, Role
from relume_server.collaboration.join import JoinRequest
from relume_server.collaboration.member import RoomEntry
from relume_server.collaboration.room import Room, with_local_settings
from relume_server.errors import BusyError
from relume_server.schemas.rooms import ROOM_PREFIX

Key = tuple[str, str]


class Rooms:
    """Rooms by scene and by what opens them to watch. Used from the event loop only."""

    def __init__(self, max_rooms: int, max_people: int, away_seconds: float) -> None:
        self._max_rooms, self._max_people, self._away_seconds = max_rooms, max_people, away_seconds
        self._rooms: dict[Key, Room] = {}

    def enter(
        self,
        join_request: JoinRequest,
        scene: str,
        caller: Caller,
        initial_document: Mapping[str, Any],
        *,
        has_local_settings: bool,
    ) -> RoomEntry:
        """A session comes in; whoever may edit and finds nobody makes the room, with the look that they bring.

        Args:
            scene: id. initial_document: the complete look that the session would show by itself.
            has_local_settings: its ways of looking are the person's own, of a session that was lost.
        Raises:
            BusyError: there are as many rooms, or people in this one, as may be; or nobody has made it yet.
        """
        key = scene, join_request.view_token
        room = self._rooms.get(key)
        is_new = room is None
        if room is None:
            if caller.role < Role.EDIT:
                raise BusyError("nobody is in this room now; it opens when somebody comes who may edit in it")
            if len(self._rooms) >= self._max_rooms:
                raise BusyError(f"{self._max_rooms} rooms are open; one of them has to be left first")
            room = Room(dict(initial_document), self._max_people, self._away_seconds, partial(self._discard, key))
        participant = room.join(join_request, caller)
        self._rooms[key] = room
        return RoomEntry(
            room,
            participant,
            join_request,
            with_local_settings(room.document, initial_document if has_local_settings else room.document),
            is_new,
        )

    def scenes(self) -> set[str]:
        """Ids of the scenes that people work on together."""
        return {scene for scene, _ in self._rooms}

    def prefixes(self) -> set[str]:
        """What the names of the rooms begin with."""
        return {watch[:ROOM_PREFIX] for _, watch in self._rooms}

    def lose(self, prefix: str) -> None:
        """Another server has the rooms of this prefix: who is in them hears of it, and nobody comes in any more."""
        for key in [key for key in self._rooms if key[1].startswith(prefix)]:
            self._rooms.pop(key).is_lost.set()

    def notify_comment(self, scene: str) -> None:
        """Tell everybody who works on a scene together that its comments have changed."""
        for (room_scene, _), room in self._rooms.items():
            if room_scene == scene:
                room.notify_comments()

    def _discard(self, key: Key, room: Room) -> None:
        if self._rooms.get(key) is room:
            del self._rooms[key]

    def close(self) -> None:
        """Forget all of them."""
        for room in self._rooms.values():
            room.close()
