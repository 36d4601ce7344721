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
        number: from 1 on, in the order of coming. num_sessions: that are open now.
        name: that others read. owner: whose it is, as quotas name them; empty if nobody logs in.
        removal: takes the place away in a while, where none is.
    """

    token: str
    number: int
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
            number=self.number,
            name=self.name,
            color=self.color,
            material=self.material,
            role=self.role.label,
            here=self.num_sessions > 0,
        )
