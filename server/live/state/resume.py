"""What was seen in sessions that were lost, kept for a while under a token that only their client knows.

A client often notices a broken connection long before the server does, so live sessions can be resumed as well.
"""

from __future__ import annotations

import secrets
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

from server.live.state.look_state import LookState
from server.live.state.shown_views import ShownViews

MAX_KEPT = 256


@dataclass(frozen=True)
class Kept:
    """What a session comes back to."""

    bake: str
    document: dict[str, Any]
    revision: int
    solo: frozenset[str] | None
    views: tuple[str, ...]
    focus: str
    until_s: float


def _kept(bake: str, look: LookState, shown: ShownViews, until_s: float) -> Kept:
    return Kept(bake, look.document, look.revision, look.solo, shown.names, shown.focus, until_s)


class ResumeStore:
    """Bounded in number and time; the oldest go first. Used from the event loop only."""

    def __init__(self, resume_seconds: float) -> None:
        self._resume_seconds = resume_seconds
        self._live: dict[str, tuple[str, LookState, ShownViews]] = {}
        self._kept: OrderedDict[str, Kept] = OrderedDict()

    def open(self, bake: str, look: LookState, shown: ShownViews) -> str:
        """A session begins; returns its token, which cannot be guessed."""
        token = secrets.token_urlsafe(24)
        self._live[token] = bake, look, shown
        return token

    def close(self, token: str, now_s: float) -> None:
        """A session ends: keep its look, unless it was resumed already."""
        if token not in self._live:
            return
        self._kept[token] = _kept(*self._live.pop(token), now_s + self._resume_seconds)
        while len(self._kept) > MAX_KEPT or next(iter(self._kept.values())).until_s < now_s:
            self._kept.popitem(last=False)

    def take(self, token: str, bake: str, now_s: float) -> Kept | None:
        """The session of that token on that bake, once; None where there is none (any more)."""
        if token in self._live and self._live[token][0] == bake:
            return _kept(*self._live.pop(token), now_s)
        kept = self._kept.get(token)
        if kept is None or kept.bake != bake:
            return None
        del self._kept[token]
        return kept if kept.until_s >= now_s else None

    def looks(self, now_s: float) -> list[tuple[str, dict[str, Any]]]:
        """The bake and the look of each session, open or lost and awaited; these documents are never written to."""
        looks = [(bake, look.document) for bake, look, _ in self._live.values()]
        return looks + [(kept.bake, kept.document) for kept in self._kept.values() if kept.until_s >= now_s]
