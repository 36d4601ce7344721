"""Errors of the client; what takes too long raises the built-in TimeoutError."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


class RelumeClientError(Exception):
    """Base of all errors of this package."""


class ServerUnavailableError(RelumeClientError):
    """The server cannot be reached, or it is stopping."""


class ServerVersionError(RelumeClientError):
    """The address has no relume server, or one of another version."""


class ProblemError(RelumeClientError):
    """The server rejected a call; the message says what to do.

    Attributes:
        status: HTTP status, or close code of a session.
        kind: last part of the problem's type, such as "plan" or "not-found".
        errors: an entry for each invalid value, as in docs/api.md.
    """

    def __init__(self, status: int, kind: str, detail: str, errors: Sequence[Any] = ()) -> None:
        super().__init__(detail)
        self.status, self.kind, self.errors = status, kind, errors


class AccessError(ProblemError):
    """The token is missing, was refused, or has a role that does not allow the call."""


class JobFailedError(RelumeClientError):
    """A bake or a render failed or was canceled; the message is the server's."""


class EditRejectedError(RelumeClientError):
    """An edit was rejected; the look is the last one that was shown."""
