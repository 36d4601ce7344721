"""One session in a room: its edits go to all others, theirs come to it.

A client knows of its own edits by itself. It is told the difference between that look and the one that there is, which
is found when it can be sent: however much others edit and however slowly a client reads, nothing piles up.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from relume.errors import ParameterError
from relume.look.difference import Operation, difference
from relume.look.patch import rebased
from server.live.rooms.door import Door, check_person
from server.live.rooms.room import OWN, Room, seen_by
from server.live.rooms.seat import Seat
from server.live.state.client_socket import ClientSocket
from server.live.state.look_state import LookState
from server.live.state.pending_requests import PendingRequests
from server.live.state.target import Target
from server.wire.rooms import CommentsMessage, PresenceMessage, RoomInfo, RoomMessage, SharedMessage, SharedOperation

PACE_S = 1 / 60
_UNKNOWN = math.nan  # as a value of a look it equals none, itself included


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
        self._client, self._client_revision = look.document, look.revision  # what the client takes the look for
        self._last_patch: Sequence[Operation] = ()
        # the room's look without what this session edited since its pictures showed its edits, or will if they can
        self._painted = self._painting = place.room.document
        self._told_people = place.room.people()
        self._authors: set[int] = set()
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

    def edited(self, target: Target, patch: Sequence[Operation]) -> Target:
        """The session's own edit was accepted: all others follow, if it is more than another way of looking.

        Args:
            patch: that made the look of `target`, as the client sent it.
        Returns:
            What is to be shown here, which says how often the room's look has changed.
        """
        self._client, self._last_patch = rebased(self._client, patch), patch
        return self._change(target)

    def _change(self, target: Target) -> Target:
        """Make this the room's look, if this session may edit; else only the session shows it."""
        changes: Sequence[Operation] = ()
        if self._may_edit:
            changes = difference(self._room.document, target.document, OWN)
            self._room.document = target.document
            self._room.num_changes += bool(changes)
        target = replace(target, shared=self._room.num_changes)
        self._note(self._seat.number)
        for other in self._room.guests:
            if changes and other is not self:
                other.follow(target, self._seat.number, changes)
        return target

    def painting(self, target: Target) -> None:
        """The session's pictures are about to be given this look: the room's, or an older one that they could show."""
        is_newest = target.shared == self._room.num_changes
        self._painting = self._room.document if is_newest else self._painted

    def painted(self) -> None:
        """They can show it: none of the edits in it will be taken back."""
        self._painted = self._painting

    def without_own(self, shown: Target) -> Target | None:
        """The room's look without what this session edited since its pictures showed `shown`; None if that is nothing.

        Raises RelumeError where that is no look.
        """
        document = seen_by(self._painted if self._may_edit else self._room.document, shown.document)
        is_own = bool(difference(document, self._look.document)) or self._look.solo != shown.solo
        return self._look.reverted(document, shown) if is_own else None

    def taken_back(self, target: Target) -> Target:
        """The newest edit of this session was not possible: all, and its own client, go on with this look instead."""
        self._look.revert(target)
        unknown = [{"op": "add", "path": each["path"], "value": _UNKNOWN} for each in self._last_patch if each["path"]]
        self._client = rebased(self._client, unknown) if len(unknown) == len(self._last_patch) else {}
        return self._change(target)

    def follow(self, target: Target, author: int, changes: Sequence[Operation]) -> None:
        """Show what somebody else has made of the look by these changes."""
        self._painted, self._painting = rebased(self._painted, changes), rebased(self._painting, changes)
        document = seen_by(target.document, self._look.document)
        self._pending.target = self._look.follow(document, target)
        self._pending.news.set()
        self._note(author)

    def _note(self, author: int) -> None:
        self._authors.add(author)
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
        """What the look has become besides what the client did by itself; of that only how far it was accepted."""
        document, revision = self._look.document, self._look.revision
        patch = difference(self._client, document)
        authors, self._authors = sorted(self._authors), set()
        if not patch and revision == self._client_revision:
            return None
        self._client, self._client_revision = document, revision
        operations = [SharedOperation(**each) for each in patch]
        return SharedMessage(revision=revision, shared=self._room.num_changes, patch=operations, by=authors)

    def leave(self, *, is_for_good: bool) -> None:
        """The session has ended; `is_for_good` where the client said so, else it may come back."""
        self._room.guests.remove(self)
        self._room.stand_up(self._seat, is_for_good=is_for_good)
