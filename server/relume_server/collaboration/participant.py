"""The place of somebody in a room. It outlives a lost connection, and two sessions of one editor share it."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field

from relume_server.auth.roles import Role
from relume_server.schemas.rooms import Person

COLORS = ("#6cb2ff", "#ffb454", "#8fd67a", "#e58ce0", "#5fd8d0", "#ff8f80", "#d9d36a", "#b3a4ff")


@dataclass
class Participant:
    """Who somebody is to the others.

    Attributes:
        id: from 1 on, in the order of coming. num_sessions: that are open now.
        name: that others read. owner: whose it is, as quotas name them; empty if nobody logs in.
        removal: takes the place away in a while, where none is.
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
        """As it is told."""
        return Person(
            id=self.id,
            name=self.name,
            color=self.color,
            material=self.material,
            role=self.role.label,
            online=self.num_sessions > 0,
        )
