"""Whose turn it is: what somebody waits for first, then client by client, then who came first."""

from __future__ import annotations

from collections.abc import Sequence
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
    """Remembers whose turns have been."""

    def __init__(self) -> None:
        self._count = 0
        self._last: dict[str, int] = {}

    def next(self, waiting: Sequence[Waiting]) -> Waiting:
        """Whose turn it is now, among at least one; it has had it then."""
        chosen = min(waiting, key=lambda work: (not work.is_first, self._last.get(work.client, 0), work.created))
        self._count += 1
        clients = {work.client for work in waiting}
        self._last = {client: turn for client, turn in self._last.items() if client in clients}
        self._last[chosen.client] = self._count
        return chosen
