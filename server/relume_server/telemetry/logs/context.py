"""Log context (request, session, bake, user), which follows a request into its tasks and threads."""

from __future__ import annotations

from contextvars import ContextVar

REQUEST: ContextVar[str] = ContextVar("request", default="")
SESSION: ContextVar[str] = ContextVar("session", default="")
BAKE: ContextVar[str] = ContextVar("bake", default="")
USER: ContextVar[str] = ContextVar("user", default="")

FIELDS = (REQUEST, SESSION, BAKE, USER)


def current() -> dict[str, str]:
    """Known fields."""
    return {field.name: value for field in FIELDS if (value := field.get())}
