"""One session in a room: its edits go to all others, theirs come to it.

What a client is told is the difference between what it was told last and what there is now, its own edits in it. It is
found when it can be sent: however much others edit and however slowly a client reads, nothing piles up.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace
from typing import Any

from relume.errors import ParameterError
from relume.look.difference import difference
from server.live.rooms.door import Door, check_person
from server.live.rooms.room import OWN, Room, seen_by
from server.live.rooms.seat import Seat
from server.live.state.client_socket import ClientSocket
from server.live.state.look_state import LookState
from server.live.state.pending_requests import PendingRequests
from server.live.state.target import Target
from server.wire.rooms import CommentsMessage, PresenceMessage, RoomInfo, RoomMessage, SharedMessage, SharedOperation

PACE_S = 1 / 60


@dataclass(frozen=True)
class Place:
    """Where a session has come to.

    Attributes:
        document: complete look that it begins with. is_new: nobody was in the room.
    """

    room: Room
    seat: Seat
    door: Door
    document: dict[str, Any]
    is_new: bool


class Guest:
    """Sits between a session and its room; on the event loop.

    Args:
        look, pending: where others' edits come to, and are asked to be shown. may_edit: more than ways of looking.
    Attributes:
        news: something is to be told to the client. has_comments: such as that there are comments.
    """

    def __init__(self, place: Place, look: LookState, pending: PendingRequests, *, may_edit: bool) -> None:
        self._place, self._room, self._seat, self._may_edit = place, place.room, place.seat, may_edit
        self._look, self._pending = look, pending
        self.news, self.has_comments = asyncio.Event(), False
        self._told, self._told_revision = place.room.document, look.revision
        self._told_people = place.room.people()
        self._authors: set[int] = set()
        self._has_others = False
        self._room.guests.append(self)

    async def lost(self) -> None:
        """Wait until another server has the room."""
        await self._room.is_lost.wait()

    def info(self) -> RoomInfo:
        """What hello says of the room."""
        return RoomInfo(
            id=self._place.door.room,
            watch=self._place.door.watch,
            seat=self._seat.token,
            you=self._seat.number,
            created=self._place.is_new,
            people=self._told_people,
            default=self._look.default,
        )

    def edited(self, target: Target) -> Target:
        """The session's own edit was accepted: everybody else follows, where it is more than another way of looking.

        Returns:
            What is to be shown here, which says how often the room's look has changed.
        """
        is_seen = bool(difference(self._room.document, target.document, OWN))
        if self._may_edit:  # else it is only a way of looking, which whoever comes next does not begin with
            self._room.document = target.document
        self._room.num_changes += is_seen
        target = replace(target, shared=self._room.num_changes)
        self._note(self._seat.number, is_own=True)
        for other in self._room.guests:
            if is_seen and other is not self:
                other.follow(target, self._seat.number)
        return target

    def taken_back(self, target: Target) -> Target:
        """An edit of this session turned out not to be possible: all, and its own client, go back to this look."""
        self._has_others = True
        return self.edited(target)

    def follow(self, target: Target, author: int) -> None:
        """Show what somebody else has made of the look."""
        document = seen_by(target.document, self._look.document)
        self._pending.target = self._look.follow(document, target)
        self._pending.news.set()
        self._note(author, is_own=False)

    def _note(self, author: int, *, is_own: bool) -> None:
        self._authors.add(author)
        self._has_others = self._has_others or not is_own
        self.news.set()

    def present(self, message: PresenceMessage, caller_name: str) -> None:
        """Take note of a name, where nobody logs in, and of the material in hand. Raises ParameterError."""
        materials = self._room.document["materials"]
        if message.material is not None and message.material not in materials:
            raise ParameterError("material", message.material, "one of " + ", ".join(materials)[:400])
        if message.name is not None and not caller_name:
            self._seat.name = check_person(message.name)
        self._seat.material = message.material
        self._room.tell_people()

    async def tell(self, socket: ClientSocket) -> None:
        """Run as long as the session does."""
        while True:
            await self.news.wait()
            self.news.clear()
            people = self._room.people()
            if people != self._told_people:
                self._told_people = people
                await socket.send(RoomMessage(you=self._seat.number, people=people))
            if self.has_comments:
                self.has_comments = False
                await socket.send(CommentsMessage())
            if (shared := self._shared()) is not None:
                await socket.send(shared)
            await asyncio.sleep(PACE_S)

    def _shared(self) -> SharedMessage | None:
        """What the look has become; of what the client did by itself only how far that was accepted."""
        document, revision = self._room.document, self._look.revision
        patch = difference(self._told, document, OWN) if self._has_others else []
        authors, self._authors, self._has_others = sorted(self._authors), set(), False
        if not patch and revision == self._told_revision:
            return None
        self._told, self._told_revision = document, revision
        operations = [SharedOperation(**each) for each in patch]
        return SharedMessage(revision=revision, shared=self._room.num_changes, patch=operations, by=authors)

    def leave(self, *, is_for_good: bool) -> None:
        """The session has ended; `is_for_good` where the client said so, else it may come back."""
        self._room.guests.remove(self)
        self._room.stand_up(self._seat, is_for_good=is_for_good)
