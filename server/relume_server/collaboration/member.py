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

from relume.core.errors import ParameterError
from relume.look.difference import Operation, diff_looks
from relume.look.patch import rebase
from relume_server.client_state.look_state import LookState
from relume_server.client_state.pending_requests import PendingRequests
from relume_server.client_state.socket import ClientSocket
from relume_server.client_state.target import Target
from relume_server.collaboration.join import JoinRequest, check_person
from relume_server.collaboration.participant import Participant
from relume_server.collaboration.room import LOCAL_SECTIONS, Room, with_local_settings
from relume_server.schemas.rooms import (
    CommentsMessage,
    PresenceMessage,
    RoomInfo,
    RoomMessage,
    RoomUpdate,
    SharedOperation,
)

SEND_INTERVAL_S = 1 / 60
_UNKNOWN = math.nan  # as a value of a look it equals none, itself included


@dataclass(frozen=True)
class RoomEntry:
    """Where a session has come to.

    Attributes:
        document: complete look that it begins with. is_new: nobody was in the room.
    """

    room: Room
    participant: Participant
    join_request: JoinRequest
    document: dict[str, Any]
    is_new: bool


class RoomMember:
    """Sits between a session and its room; on the event loop.

    Args:
        look, pending: where others' edits come to, and are asked to be shown. may_edit: more than ways of looking.
    Attributes:
        changed: something is to be told to the client. has_comments: such as that there are comments.
    """

    def __init__(self, entry: RoomEntry, look: LookState, pending: PendingRequests, *, may_edit: bool) -> None:
        self._entry, self._room, self._participant, self._may_edit = entry, entry.room, entry.participant, may_edit
        self._look, self._pending = look, pending
        self.changed, self.has_comments = asyncio.Event(), False
        self._client, self._client_revision = look.document, look.revision  # what the client takes the look for
        self._last_patch: Sequence[Operation] = ()
        # the room's look without what this session edited since its pictures showed its edits, or will if they can
        self._painted = self._painting = entry.room.document
        self._sent_people = entry.room.people()
        self._authors: set[int] = set()
        self._room.members.append(self)

    async def wait_until_lost(self) -> None:
        """Wait until another server has the room."""
        await self._room.is_lost.wait()

    def info(self) -> RoomInfo:
        """What hello says of the room."""
        return RoomInfo(
            id=self._entry.join_request.room,
            view_token=self._entry.join_request.view_token,
            participant_token=self._participant.token,
            self_id=self._participant.id,
            is_new=self._entry.is_new,
            people=self._sent_people,
            default_look=self._look.default,
        )

    def accepted(self, target: Target, patch: Sequence[Operation]) -> Target:
        """The session's own edit was accepted: all others follow, if it is more than another way of looking.

        Args:
            patch: that made the look of `target`, as the client sent it.
        Returns:
            What is to be shown here, which says how often the room's look has changed.
        """
        self._client, self._last_patch = rebase(self._client, patch), patch
        return self._change(target)

    def _change(self, target: Target) -> Target:
        """Make this the room's look, if this session may edit; else only the session shows it."""
        changes: Sequence[Operation] = ()
        if self._may_edit:
            changes = diff_looks(self._room.document, target.document, LOCAL_SECTIONS)
            self._room.document = target.document
            self._room.num_changes += bool(changes)
        target = replace(target, room_revision=self._room.num_changes)
        self._note(self._participant.id)
        for member in self._room.members:
            if changes and member is not self:
                member.on_remote_edit(target, self._participant.id, changes)
        return target

    def on_painting(self, target: Target) -> None:
        """The session's pictures are about to be given this look: the room's, or an older one that they could show."""
        is_newest = target.room_revision == self._room.num_changes
        self._painting = self._room.document if is_newest else self._painted

    def on_painted(self) -> None:
        """They can show it: none of the edits in it will be taken back."""
        self._painted = self._painting

    def without_own_edits(self, displayed: Target) -> Target | None:
        """The room's look without this session's edits since its pictures showed `displayed`; None if there are none.

        Raises RelumeError where that is no look.
        """
        document = with_local_settings(self._painted if self._may_edit else self._room.document, displayed.document)
        has_own_edits = bool(diff_looks(document, self._look.document)) or self._look.solo != displayed.solo
        return self._look.reverted(document, displayed) if has_own_edits else None

    def reverted(self, target: Target) -> Target:
        """The newest edit of this session was not possible: all, and its own client, go on with this look instead."""
        self._look.revert(target)
        unknown = [{"op": "add", "path": each["path"], "value": _UNKNOWN} for each in self._last_patch if each["path"]]
        self._client = rebase(self._client, unknown) if len(unknown) == len(self._last_patch) else {}
        return self._change(target)

    def on_remote_edit(self, target: Target, author: int, changes: Sequence[Operation]) -> None:
        """Show what somebody else has made of the look by these changes."""
        self._painted, self._painting = rebase(self._painted, changes), rebase(self._painting, changes)
        document = with_local_settings(target.document, self._look.document)
        self._pending.target = self._look.adopt(document, target)
        self._pending.changed.set()
        self._note(author)

    def _note(self, author: int) -> None:
        self._authors.add(author)
        self.changed.set()

    def update_presence(self, message: PresenceMessage, caller_name: str) -> None:
        """Take note of a name, where nobody logs in, and of the material in hand. Raises ParameterError."""
        materials = self._room.document["materials"]
        if message.material is not None and message.material not in materials:
            raise ParameterError("material", message.material, "one of " + ", ".join(materials)[:400])
        if message.name is not None and not caller_name:
            self._participant.name = check_person(message.name)
        self._participant.material = message.material
        self._room.notify_people()

    async def send_updates(self, socket: ClientSocket) -> None:
        """Run as long as the session does."""
        while True:
            await self.changed.wait()
            self.changed.clear()
            people = self._room.people()
            if people != self._sent_people:
                self._sent_people = people
                await socket.send(RoomMessage(self_id=self._participant.id, people=people))
            if self.has_comments:
                self.has_comments = False
                await socket.send(CommentsMessage())
            if (shared := self._room_update()) is not None:
                await socket.send(shared)
            await asyncio.sleep(SEND_INTERVAL_S)

    def _room_update(self) -> RoomUpdate | None:
        """What the look has become besides what the client did by itself; of that only how far it was accepted."""
        document, revision = self._look.document, self._look.revision
        patch = diff_looks(self._client, document)
        authors, self._authors = sorted(self._authors), set()
        if not patch and revision == self._client_revision:
            return None
        self._client, self._client_revision = document, revision
        operations = [SharedOperation(**each) for each in patch]
        return RoomUpdate(revision=revision, room_revision=self._room.num_changes, patch=operations, edited_by=authors)

    def leave(self, *, is_for_good: bool) -> None:
        """The session has ended; `is_for_good` where the client said so, else it may come back."""
        self._room.members.remove(self)
        self._room.leave(self._participant, is_for_good=is_for_good)
