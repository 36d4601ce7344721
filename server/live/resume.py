"""Looks of sessions that were lost, kept for a while under a token that only their client knows."""

from __future__ import annotations

import secrets
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

MAX_KEPT = 256


@dataclass(frozen=True)
class Kept:
    """What a session comes back to."""

    bake: str
    document: dict[str, Any]
    revision: int
    until_s: float


class ResumeStore:
    """Bounded in number and time; the oldest go first."""

    def __init__(self, resume_seconds: float) -> None:
        self._resume_seconds = resume_seconds
        self._kept: OrderedDict[str, Kept] = OrderedDict()

    @staticmethod
    def new_token() -> str:
        """A token that cannot be guessed."""
        return secrets.token_urlsafe(24)

    def keep(self, token: str, bake: str, document: dict[str, Any], revision: int, now_s: float) -> None:
        """Remember a session from its end on."""
        self._kept[token] = Kept(bake, document, revision, now_s + self._resume_seconds)
        self._kept.move_to_end(token)
        while len(self._kept) > MAX_KEPT or next(iter(self._kept.values())).until_s < now_s:
            self._kept.popitem(last=False)

    def take(self, token: str, bake: str, now_s: float) -> Kept | None:
        """The session of that token on that bake, once; None where there is none (any more)."""
        kept = self._kept.get(token)
        if kept is None or kept.bake != bake:
            return None
        del self._kept[token]
        return kept if kept.until_s >= now_s else None
