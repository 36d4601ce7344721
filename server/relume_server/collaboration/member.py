"""One session in a room: its edits go to all others, and theirs come to it.

A client knows its own edits. It receives the difference between its look and the room's, computed when it can be sent:
nothing accumulates, however many edits there are and however slowly the client reads.
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
_UNKNOWN = math.nan  # equals no value of a look, not even itself


@dataclass(frozen=True)
class RoomEntry:
    """A joined room.

    Attributes:
        document: complete look to start with. is_new: the room was empty.
    """

    room: Room
    participant: Participant
    join_request: JoinRequest
    document: dict[str, Any]
    is_new: bool


class RoomMember:
    """Connects a session to its room. Event loop only.

    Args:
        entry: entry of the room. look, pending: look and pending requests of the session, updated by others' edits.
        may_edit: the session may edit more than view settings.
    Attributes:
        changed: set when something is to be sent. has_comments: comments have changed.
    """

    def __init__(self, entry: RoomEntry, look: LookState, pending: PendingRequests, *, may_edit: bool) -> None:
        self._entry, self._room, self._participant, self._may_edit = entry, entry.room, entry.participant, may_edit
        self._look, self._pending = look, pending
        self.changed, self.has_comments = asyncio.Event(), False
        self._client, self._client_revision = look.document, look.revision  # the look that the client has
        self._last_patch: Sequence[Operation] = ()
        # the room's look without this session's edits that its images have not shown yet
        self._painted = self._painting = entry.room.document
        self._sent_people = entry.room.people()
        self._authors: set[int] = set()
        self._room.members.append(self)

    async def wait_until_lost(self) -> None:
        """Wait until another server has the room."""
        await self._room.is_lost.wait()

    def info(self) -> RoomInfo:
        """Room of the hello message."""
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
        """Pass the session's accepted edit on to all others, unless it changes view settings only.

        Args:
            target: target after the edit. patch: JSON Patch of the edit, as sent by the client.
        Returns:
            The target to show here, with its `room_revision`.
        """
        self._client, self._last_patch = rebase(self._client, patch), patch
        return self._change(target)

    def _change(self, target: Target) -> Target:
        """Set the room's look, if this session may edit; otherwise only the session shows it."""
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
        """Record that the images are about to get this look: the room's, or an older one that they support."""
        is_newest = target.room_revision == self._room.num_changes
        self._painting = self._room.document if is_newest else self._painted

    def on_painted(self) -> None:
        """Record that the images support it: none of its edits will be reverted."""
        self._painted = self._painting

    def without_own_edits(self, displayed: Target) -> Target | None:
        """The room's look without this session's edits since its images showed `displayed`; None if there are none.

        Raises RelumeError if the result is not a valid look.
        """
        document = with_local_settings(self._painted if self._may_edit else self._room.document, displayed.document)
        has_own_edits = bool(diff_looks(document, self._look.document)) or self._look.solo != displayed.solo
        return self._look.reverted(document, displayed) if has_own_edits else None

    def reverted(self, target: Target) -> Target:
        """Replace the room's look because the newest edit of this session is not supported."""
        self._look.revert(target)
        unknown = [{"op": "add", "path": each["path"], "value": _UNKNOWN} for each in self._last_patch if each["path"]]
        self._client = rebase(self._client, unknown) if len(unknown) == len(self._last_patch) else {}
        return self._change(target)

    def on_remote_edit(self, target: Target, author: int, changes: Sequence[Operation]) -> None:
        """Show the look that another participant made by these changes."""
        self._painted, self._painting = rebase(self._painted, changes), rebase(self._painting, changes)
        document = with_local_settings(target.document, self._look.document)
        self._pending.target = self._look.adopt(document, target)
        self._pending.changed.set()
        self._note(author)

    def _note(self, author: int) -> None:
        self._authors.add(author)
        self.changed.set()

    def update_presence(self, message: PresenceMessage, caller_name: str) -> None:
        """Set the name, if there is no login, and the selected material. Raises ParameterError."""
        materials = self._room.document["materials"]
        if message.material is not None and message.material not in materials:
            raise ParameterError("material", message.material, "one of " + ", ".join(materials)[:400])
        if message.name is not None and not caller_name:
            self._participant.name = check_person(message.name)
        self._participant.material = message.material
        self._room.notify_people()

    async def send_updates(self, socket: ClientSocket) -> None:
        """Send updates while the session runs."""
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
        """Changes of the look besides the client's own edits, and how far those were accepted."""
        document, revision = self._look.document, self._look.revision
        patch = diff_looks(self._client, document)
        authors, self._authors = sorted(self._authors), set()
        if not patch and revision == self._client_revision:
            return None
        self._client, self._client_revision = document, revision
        operations = [SharedOperation(**each) for each in patch]
        return RoomUpdate(revision=revision, room_revision=self._room.num_changes, patch=operations, edited_by=authors)

    def leave(self, *, is_for_good: bool) -> None:
        """End the membership; `is_for_good` if the client left, otherwise it may reconnect."""
        self._room.members.remove(self)
        self._room.leave(self._participant, is_for_good=is_for_good)
