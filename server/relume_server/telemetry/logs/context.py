"""What is being worked on, as every line of the log has it: it goes along into tasks and threads of a request."""

from __future__ import annotations

from contextvars import ContextVar

REQUEST: ContextVar[str] = ContextVar("request", default="")
SESSION: ContextVar[str] = ContextVar("session", default="")
BAKE: ContextVar[str] = ContextVar("bake", default="")
USER: ContextVar[str] = ContextVar("user", default="")

FIELDS = (REQUEST, SESSION, BAKE, USER)


def current() -> dict[str, str]:
    """Those that are known here."""
    return {field.name: value for field in FIELDS if (value := field.get())}
