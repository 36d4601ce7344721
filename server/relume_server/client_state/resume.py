"""State of lost sessions, kept for a while under a secret token of the client.

A client often notices a broken connection before the server does, so live sessions can be resumed as well.
"""

from __future__ import annotations

import secrets
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

from relume_server.client_state.look_state import LookState
from relume_server.client_state.visible_views import VisibleViews

MAX_SAVED = 256


@dataclass(frozen=True)
class SavedSession:
    """State to resume."""

    bake: str
    document: dict[str, Any]
    revision: int
    solo: frozenset[str] | None
    views: tuple[str, ...]
    focus: str
    until_s: float


def _saved_session(bake: str, look: LookState, visible_views: VisibleViews, until_s: float) -> SavedSession:
    return SavedSession(
        bake, look.document, look.revision, look.solo, visible_views.names, visible_views.focus, until_s
    )


class ResumeStore:
    """Bounded in number and time; the oldest are dropped first. Event loop only."""

    def __init__(self, resume_seconds: float) -> None:
        self._resume_seconds = resume_seconds
        self._live: dict[str, tuple[str, LookState, VisibleViews]] = {}
        self._saved: OrderedDict[str, SavedSession] = OrderedDict()

    def open(self, bake: str, look: LookState, visible_views: VisibleViews) -> str:
        """Register a new session; returns its secret token."""
        token = secrets.token_urlsafe(24)
        self._live[token] = bake, look, visible_views
        return token

    def close(self, token: str, now_s: float) -> None:
        """End a session: keep its state, unless it was resumed already."""
        if token not in self._live:
            return
        self._saved[token] = _saved_session(*self._live.pop(token), now_s + self._resume_seconds)
        while len(self._saved) > MAX_SAVED or next(iter(self._saved.values())).until_s < now_s:
            self._saved.popitem(last=False)

    def take(self, token: str, bake: str, now_s: float) -> SavedSession | None:
        """Take the session of a token on a bake, once; None if there is none (any more)."""
        if token in self._live and self._live[token][0] == bake:
            return _saved_session(*self._live.pop(token), now_s)
        saved = self._saved.get(token)
        if saved is None or saved.bake != bake:
            return None
        del self._saved[token]
        return saved if saved.until_s >= now_s else None

    def looks(self, now_s: float) -> list[tuple[str, dict[str, Any]]]:
        """Bake and look of each session, open or lost; do not modify the documents."""
        looks = [(bake, look.document) for bake, look, _ in self._live.values()]
        return looks + [(saved.bake, saved.document) for saved in self._saved.values() if saved.until_s >= now_s]
