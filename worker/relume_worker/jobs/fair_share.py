"""Fair scheduling: interactive work first, then by users' shares, then first come, first served."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Waiting:
    """Work that is waiting.

    Attributes:
        client: user who submitted it. is_first: it is small. created: time of submission.
        num_elsewhere: work of its client that runs elsewhere, on other servers and machines.
        kind, lane: of a job, see `relume_worker.jobs.job.lane`.
        priority: higher ones are first among the work of a client.
    """

    id: str
    client: str
    is_first: bool
    created: float
    num_elsewhere: int = 0
    kind: str = ""
    lane: str = ""
    priority: int = 0


class FairShare:
    """Schedules clients by their shares.

    Each client has a virtual time that advances by 1 / share per turn; the earliest is next (stride scheduling:
    Waldspurger and Weihl, *Stride scheduling: deterministic proportional-share resource management*, 1995). Clients who
    return start no earlier than those who waited meanwhile: turns cannot be saved up.
    Each service counts its own turns. Work that runs elsewhere counts as turns while it runs: otherwise many idle
    machines would all begin with the same client.
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
        """Sort by turn, if each is taken in this order, here or elsewhere."""
        times = {work.client: self._time(work.client) for work in waiting}
        self._earliest = min(times.values(), default=self._earliest)
        turns, num_before = dict[Waiting, tuple[bool, float, float]](), Counter[str]()
        for work in sorted(waiting, key=lambda work: (not work.is_first, -work.priority, work.created)):
            num_turns = work.num_elsewhere + num_before[work.client]
            turn_time = times[work.client] + num_turns / self._weight(work.client)
            turns[work] = not work.is_first, turn_time, work.created
            num_before[work.client] += 1
        return sorted(waiting, key=turns.__getitem__)

    def pick_next(self, client: str) -> None:
        """Record a turn of a client."""
        self._virtual_times[client] = self._time(client) + 1.0 / self._weight(client)
        self._virtual_times = {name: time for name, time in self._virtual_times.items() if time > self._earliest}

    def _weight(self, client: str) -> float:
        return self._client_weights.get(client, 1.0)

    def _time(self, client: str) -> float:
        return max(self._earliest, self._virtual_times.get(client, 0.0))
