"""A room: a shared look and its participants. Event loop only."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from relume.look.difference import Operation
from relume_server.auth.roles import Caller
from relume_server.client_state.target import Target
from relume_server.collaboration.join import JoinRequest
from relume_server.collaboration.participant import COLORS, Participant
from relume_server.schemas.rooms import Person
from relume_worker.jobs.job import BusyError

LOCAL_SECTIONS = ("display", "transport")
"""View settings: sections of a look that are not shared."""


def is_local_setting(path: str) -> bool:
    """True if a pointer into a look is a view setting."""
    return path.split("/")[1:2] in ([name] for name in LOCAL_SECTIONS)


def with_local_settings(document: Mapping[str, Any], local_document: Mapping[str, Any]) -> dict[str, Any]:
    """The room's look with a participant's own view settings."""
    return {**document, **{name: local_document[name] for name in LOCAL_SECTIONS}}


class Listener(Protocol):
    """A session in a room; see `relume_server.collaboration.member.RoomMember`."""

    changed: asyncio.Event
    has_comments: bool

    def on_remote_edit(self, target: Target, author: int, changes: Sequence[Operation]) -> None: ...


class Room:
    """One shared look.

    Attributes:
        document: complete look, with the view settings of the last editor. num_changes: its revision.
        members: sessions in the room. is_lost: another server has it.
    """

    def __init__(
        self, document: dict[str, Any], max_people: int, away_seconds: float, on_empty: Callable[[Room], None]
    ) -> None:
        self.document, self.num_changes = document, 0
        self.members: list[Listener] = []
        self.is_lost = asyncio.Event()
        self._participants: dict[str, Participant] = {}
        self._max_people, self._away_seconds, self._on_empty = max_people, away_seconds, on_empty
        self._num_joined = 0

    def people(self) -> list[Person]:
        """Participants in joining order."""
        return [participant.person() for participant in self._participants.values()]

    def join(self, join_request: JoinRequest, caller: Caller) -> Participant:
        """Return the participant that a session resumes, or a new one. Raises BusyError if the room is full."""
        participant = self._participants.get(join_request.participant_token or "")
        if participant is None or participant.owner != caller.name:
            participant = self._add_participant(join_request, caller)
        if participant.removal is not None:
            participant.removal.cancel()
            participant.removal = None
        participant.num_sessions += 1
        participant.role = caller.role
        self.notify_people()
        return participant

    def _add_participant(self, join_request: JoinRequest, caller: Caller) -> Participant:
        if len(self._participants) >= self._max_people:
            raise BusyError(f"{self._max_people} people are in this room, which is its limit; wait until one leaves")
        self._num_joined += 1
        used_colors = {participant.color for participant in self._participants.values()}
        color = next((color for color in COLORS if color not in used_colors), COLORS[self._num_joined % len(COLORS)])
        name = caller.person or join_request.name or f"Guest {self._num_joined}"
        participant = Participant(secrets.token_urlsafe(24), self._num_joined, color, name, caller.role, caller.name)
        self._participants[participant.token] = participant
        return participant

    def leave(self, participant: Participant, *, is_for_good: bool) -> None:
        """End a session of a participant, who stays for a while unless the last one left for good."""
        participant.num_sessions -= 1
        if participant.num_sessions == 0 and is_for_good:
            self._remove_participant(participant)
        elif participant.num_sessions == 0:
            participant.removal = asyncio.get_running_loop().call_later(
                self._away_seconds, self._remove_participant, participant
            )
        self.notify_people()

    def _remove_participant(self, participant: Participant) -> None:
        del self._participants[participant.token]
        self.notify_people()
        if not self._participants:
            self._on_empty(self)

    def notify_people(self) -> None:
        """Notify members of changed participants."""
        for member in self.members:
            member.changed.set()

    def notify_comments(self) -> None:
        """Notify members of changed comments."""
        for member in self.members:
            member.has_comments = True
            member.changed.set()

    def close(self) -> None:
        """Cancel the timers of all participants."""
        for participant in self._participants.values():
            if participant.removal is not None:
                participant.removal.cancel()
