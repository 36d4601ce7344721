"""Participant of a room, who stays for a while after a lost connection; sessions of one editor share a participant."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field

from relume_server.auth.roles import Role
from relume_server.schemas.rooms import Person

COLORS = ("#6cb2ff", "#ffb454", "#8fd67a", "#e58ce0", "#5fd8d0", "#ff8f80", "#d9d36a", "#b3a4ff")


@dataclass
class Participant:
    """A person in a room.

    Attributes:
        id: from 1 on, in joining order. num_sessions: number of open sessions.
        name: display name. owner: user for quotas; empty without login.
        removal: timer that removes the participant when no session is open.
    """

    token: str
    id: int
    color: str
    name: str
    role: Role
    owner: str
    material: str | None = None
    num_sessions: int = 0
    removal: asyncio.TimerHandle | None = field(default=None, repr=False)

    def person(self) -> Person:
        """Participant as in messages."""
        return Person(
            id=self.id,
            name=self.name,
            color=self.color,
            material=self.material,
            role=self.role.label,
            online=self.num_sessions > 0,
        )
