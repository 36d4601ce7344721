"""All rooms of this process. They live as long as somebody has a place in them, and in memory alone."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from server.access.roles import Caller, Role
from server.errors import BusyError
from server.live.rooms.door import Door
from server.live.rooms.guest import Place
from server.live.rooms.room import Room, seen_by
from server.wire.rooms import ROOM_PREFIX

Key = tuple[str, str]


class Rooms:
    """Rooms by scene and by what opens them to watch. Used from the event loop only."""

    def __init__(self, max_rooms: int, max_people: int, away_seconds: float) -> None:
        self._max_rooms, self._max_people, self._away_seconds = max_rooms, max_people, away_seconds
        self._rooms: dict[Key, Room] = {}

    def enter(self, door: Door, scene: str, caller: Caller, begun: Mapping[str, Any], *, has_own: bool) -> Place:
        """A session comes in; whoever may edit and finds nobody makes the room, with the look that they bring.

        Args:
            scene: id. begun: the complete look that the session would show by itself.
            has_own: its ways of looking are the person's own, of a session that was lost.
        Raises:
            BusyError: there are as many rooms, or people in this one, as may be; or nobody has made it yet.
        """
        key = scene, door.watch
        room = self._rooms.get(key)
        is_new = room is None
        if room is None:
            if caller.role < Role.EDIT:
                raise BusyError("nobody is in this room now; it opens when somebody comes who may edit in it")
            if len(self._rooms) >= self._max_rooms:
                raise BusyError(f"{self._max_rooms} rooms are open; one of them has to be left first")
            room = Room(dict(begun), self._max_people, self._away_seconds, partial(self._forget, key))
        seat = room.sit(door, caller)
        self._rooms[key] = room
        return Place(room, seat, door, seen_by(room.document, begun if has_own else room.document), is_new)

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

    def commented(self, scene: str) -> None:
        """Tell everybody who works on a scene together that its comments have changed."""
        for (of, _), room in self._rooms.items():
            if of == scene:
                room.tell_comments()

    def _forget(self, key: Key, room: Room) -> None:
        if self._rooms.get(key) is room:
            del self._rooms[key]

    def close(self) -> None:
        """Forget all of them."""
        for room in self._rooms.values():
            room.close()
