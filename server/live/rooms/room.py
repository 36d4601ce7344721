"""A room: a look that several people share, and who they are. Used from the event loop only."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from relume.look.difference import Operation
from server.access.roles import Caller
from server.errors import BusyError
from server.live.rooms.door import Door
from server.live.rooms.seat import COLORS, Seat
from server.live.state.target import Target
from server.wire.rooms import Person

OWN = ("display", "transport")
"""Sections of a look that each has for themselves: they are ways of looking."""


def is_own_way(path: str) -> bool:
    """Whether a pointer into a look is one of a way of looking."""
    return path.split("/")[1:2] in ([name] for name in OWN)


def seen_by(document: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """A room's look with somebody's own ways of looking."""
    return {**document, **{name: own[name] for name in OWN}}


class Listener(Protocol):
    """A session in a room, as the room knows it; see `server.live.rooms.guest.Guest`."""

    news: asyncio.Event
    has_comments: bool

    def follow(self, target: Target, author: int, changes: Sequence[Operation]) -> None: ...


class Room:
    """One shared look.

    Attributes:
        document: the complete look, seen as whoever edited last sees it. num_changes: that it has seen.
        guests: sessions that are in it. is_lost: another server has it.
    """

    def __init__(
        self, document: dict[str, Any], max_people: int, away_seconds: float, emptied: Callable[[Room], None]
    ) -> None:
        self.document, self.num_changes = document, 0
        self.guests: list[Listener] = []
        self.is_lost = asyncio.Event()
        self._seats: dict[str, Seat] = {}
        self._max_people, self._away_seconds, self._emptied = max_people, away_seconds, emptied
        self._num_come = 0

    def people(self) -> list[Person]:
        """Who has a place, in the order of coming."""
        return [seat.person() for seat in self._seats.values()]

    def sit(self, door: Door, caller: Caller) -> Seat:
        """The place that a session comes back to, or a new one. Raises BusyError where there is none."""
        seat = self._seats.get(door.seat or "")
        if seat is None or seat.owner != caller.name:
            seat = self._new_seat(door, caller)
        if seat.leaving is not None:
            seat.leaving.cancel()
            seat.leaving = None
        seat.num_sessions += 1
        seat.role = caller.role
        self.tell_people()
        return seat

    def _new_seat(self, door: Door, caller: Caller) -> Seat:
        if len(self._seats) >= self._max_people:
            raise BusyError(f"{self._max_people} people are in this room; one of them has to leave first")
        self._num_come += 1
        taken = {seat.color for seat in self._seats.values()}
        color = next((color for color in COLORS if color not in taken), COLORS[self._num_come % len(COLORS)])
        name = caller.person or door.name or f"Guest {self._num_come}"
        seat = Seat(secrets.token_urlsafe(24), self._num_come, color, name, caller.role, caller.name)
        self._seats[seat.token] = seat
        return seat

    def stand_up(self, seat: Seat, *, is_for_good: bool) -> None:
        """A session of somebody has ended; their place is kept for a while, unless that was the last one for good."""
        seat.num_sessions -= 1
        if seat.num_sessions == 0 and is_for_good:
            self._leave(seat)
        elif seat.num_sessions == 0:
            seat.leaving = asyncio.get_running_loop().call_later(self._away_seconds, self._leave, seat)
        self.tell_people()

    def _leave(self, seat: Seat) -> None:
        del self._seats[seat.token]
        self.tell_people()
        if not self._seats:
            self._emptied(self)

    def tell_people(self) -> None:
        """Something about who is here has changed."""
        for guest in self.guests:
            guest.news.set()

    def tell_comments(self) -> None:
        """Somebody has commented."""
        for guest in self.guests:
            guest.has_comments = True
            guest.news.set()

    def close(self) -> None:
        """Forget whoever may still come back."""
        for seat in self._seats.values():
            if seat.leaving is not None:
                seat.leaving.cancel()
