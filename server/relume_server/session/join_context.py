"""Client and initial state of a session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from relume_server.auth.roles import Caller
from relume_server.collaboration.join import JoinRequest


@dataclass(frozen=True)
class JoinContext:
    """Contents of a client's `open` message.

    Attributes:
        resume: token of a lost session. look: complete document to start with; None: the scene's default.
        join_request: join request of the room to join; None: no room.
    """

    caller: Caller
    resume: str | None
    look: dict[str, Any] | None
    join_request: JoinRequest | None
