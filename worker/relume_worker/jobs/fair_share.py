"""Fair scheduling: interactive work first, then by users' shares, then first come, first served."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Waiting:
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
    Waldspurger and Weihl, *Stride scheduling: deterministic proportional-share resource management*, 1995). Clients who
    return start no earlier than those who waited meanwhile: turns cannot be saved up.
    """

    def __init__(self, client_weights: Mapping[str, float]) -> None:
        """
        Args:
            client_weights: shares of some clients; 1 for all others.
        """
        self._client_weights = dict(client_weights)
        self._virtual_times: dict[str, float] = {}
        self._earliest = 0.0

    def sort(self, waiting: Sequence[Waiting]) -> list[Waiting]:
        """Sort by turn, if each client took none before the next."""
        times = {work.client: self._time(work.client) for work in waiting}
        self._earliest = min(times.values(), default=self._earliest)
        return sorted(waiting, key=lambda work: (not work.is_first, times[work.client], work.created))

    def pick_next(self, client: str) -> None:
        """Record a turn of a client."""
        self._virtual_times[client] = self._time(client) + 1.0 / self._client_weights.get(client, 1.0)
        self._virtual_times = {name: time for name, time in self._virtual_times.items() if time > self._earliest}

    def _time(self, client: str) -> float:
        return max(self._earliest, self._virtual_times.get(client, 0.0))
