"""Fair scheduling: interactive work first, then by users' shares, then first come, first served."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class WaitingBake:
    """Work that is waiting.

    Attributes:
        client: user who submitted it. is_first: it is small. created: time of submission.
    """

    id: str
    client: str
    is_first: bool
    created: float


class FairShare:
    """Schedules clients by their shares.

    Each client has a virtual time that advances by 1 / share per turn; the earliest is next (stride scheduling:
    Waldspurger and Weihl, *Stride scheduling: deterministic proportional-share resource management*, 1995). New clients
    start at the earliest waiting client's time: turns cannot be saved up.
    """

    def __init__(self, client_weights: Mapping[str, float]) -> None:
        """
        Args:
            client_weights: shares of some clients; 1 for all others.
        """
        self._client_weights = dict(client_weights)
        self._virtual_times: dict[str, float] = {}

    def sort(self, waiting_bakes: Sequence[WaitingBake]) -> list[WaitingBake]:
        """Sort by turn, if each client took none before the next."""
        clients = {work.client for work in waiting_bakes}
        earliest = min(
            (self._virtual_times[client] for client in clients if client in self._virtual_times), default=0.0
        )
        self._virtual_times = {client: self._virtual_times.get(client, earliest) for client in clients}
        return sorted(
            waiting_bakes, key=lambda work: (not work.is_first, self._virtual_times[work.client], work.created)
        )

    def pick_next(self, client: str) -> None:
        """Record a turn of a client."""
        self._virtual_times[client] += 1.0 / self._client_weights.get(client, 1.0)
