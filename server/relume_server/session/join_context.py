"""Who has come to a session, and with what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from relume_server.auth.roles import Caller
from relume_server.collaboration.join import JoinRequest


@dataclass(frozen=True)
class JoinContext:
    """What a client says when it opens a session.

    Attributes:
        resume: token of a session that was lost. look: complete document that the session begins with; None: the
            scene's own.
        join_request: of the room that they come into; None: they are alone.
    """

    caller: Caller
    resume: str | None
    look: dict[str, Any] | None
    join_request: JoinRequest | None
