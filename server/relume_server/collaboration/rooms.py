"""All rooms of this process, in memory; a room exists while it has participants."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from relume_server.auth.roles import Caller, Role
from relume_server.collaboration.join import JoinRequest
from relume_server.collaboration.member import RoomEntry
from relume_server.collaboration.room import Room, with_local_settings
from relume_server.schemas.rooms import ROOM_PREFIX
from relume_worker.jobs.job import BusyError

Key = tuple[str, str]


class Rooms:
    """Rooms by scene and view token. Event loop only."""

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
        """Join a room; an editor creates it if it does not exist, with the look of the session.

        Args:
            join_request: join request of the session. scene: id. caller: caller of the session.
            initial_document: complete look of the session.
            has_local_settings: keep the session's own view settings, from a lost session.
        Raises:
            BusyError: too many rooms, or participants; or no editor has created the room yet.
        """
        key = scene, join_request.view_token
        room = self._rooms.get(key)
        is_new = room is None
        if room is None:
            if caller.role < Role.EDIT:
                raise BusyError("this room is empty; it opens when an editor joins")
            if len(self._rooms) >= self._max_rooms:
                raise BusyError(f"{self._max_rooms} rooms are open, which is the limit; wait until one is closed")
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
        """Ids of the scenes of all rooms."""
        return {scene for scene, _ in self._rooms}

    def prefixes(self) -> set[str]:
        """Prefixes of all rooms."""
        return {watch[:ROOM_PREFIX] for _, watch in self._rooms}

    def lose(self, prefix: str) -> None:
        """Close the rooms of a prefix, which another server has; members are notified."""
        for key in [key for key in self._rooms if key[1].startswith(prefix)]:
            self._rooms.pop(key).is_lost.set()

    def notify_comment(self, scene: str) -> None:
        """Notify all rooms of a scene that its comments have changed."""
        for (room_scene, _), room in self._rooms.items():
            if room_scene == scene:
                room.notify_comments()

    def _discard(self, key: Key, room: Room) -> None:
        if self._rooms.get(key) is room:
            del self._rooms[key]

    def close(self) -> None:
        """Close all rooms."""
        for room in self._rooms.values():
            room.close()
