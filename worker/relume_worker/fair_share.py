"""Whose turn it is: what somebody waits for first, then user by user as their shares say, then who came first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class WaitingBake:
    """Work that is not done.

    Attributes:
        client: who asked for it. is_first: it is a small one. created: when it was asked for.
    """

    id: str
    client: str
    is_first: bool
    created: float


class FairShare:
    """Remembers whose turns have been.

    Each client has a time of their own, which a turn puts on by 1 / share; the earliest is next (stride scheduling:
    Waldspurger and Weihl, *Stride scheduling: deterministic proportional-share resource management*, 1995). Whoever
    comes new begins where the earliest of those who wait is: nobody saves turns up.
    """

    def __init__(self, client_weights: Mapping[str, float]) -> None:
        """
        Args:
            client_weights: turns of some clients, to one of each other.
        """
        self._client_weights = dict(client_weights)
        self._virtual_times: dict[str, float] = {}

    def sort(self, waiting_bakes: Sequence[WaitingBake]) -> list[WaitingBake]:
        """In the order of their turns, if each took none before the next."""
        clients = {work.client for work in waiting_bakes}
        earliest = min(
            (self._virtual_times[client] for client in clients if client in self._virtual_times), default=0.0
        )
        self._virtual_times = {client: self._virtual_times.get(client, earliest) for client in clients}
        return sorted(
            waiting_bakes, key=lambda work: (not work.is_first, self._virtual_times[work.client], work.created)
        )

    def pick_next(self, client: str) -> None:
        """A client of those that were ordered has a turn."""
        self._virtual_times[client] += 1.0 / self._client_weights.get(client, 1.0)
