"""Whose turn it is: what somebody waits for first, then user by user as their shares say, then who came first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Waiting:
    """Work that is not done.

    Attributes:
        client: who asked for it. is_first: it is a small one. created: when it was asked for.
    """

    id: str
    client: str
    is_first: bool
    created: float


class Turns:
    """Remembers whose turns have been.

    Each client has a time of their own, which a turn puts on by 1 / share; the earliest is next (stride scheduling:
    Waldspurger and Weihl, *Stride scheduling: deterministic proportional-share resource management*, 1995). Whoever
    comes new begins where the earliest of those who wait is: nobody saves turns up.
    """

    def __init__(self, shares: Mapping[str, float]) -> None:
        """
        Args:
            shares: turns of some clients, to one of each other.
        """
        self._shares = dict(shares)
        self._times: dict[str, float] = {}

    def order(self, waiting: Sequence[Waiting]) -> list[Waiting]:
        """In the order of their turns, if each took none before the next."""
        clients = {work.client for work in waiting}
        earliest = min((self._times[client] for client in clients if client in self._times), default=0.0)
        self._times = {client: self._times.get(client, earliest) for client in clients}
        return sorted(waiting, key=lambda work: (not work.is_first, self._times[work.client], work.created))

    def take(self, client: str) -> None:
        """A client of those that were ordered has a turn."""
        self._times[client] += 1.0 / self._shares.get(client, 1.0)
