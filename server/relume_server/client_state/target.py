"""What a session is to show: a look, and since when it is wanted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relume.scene.model import Camera


@dataclass(frozen=True)
class Target:
    """A look that shall be shown.

    Attributes:
        look: validated. document: the same as JSON.
        received_s: when the edit came in; None for a look that no edit asked for. applied_s: when it had been applied.
        active_pointer: pointer to what the hand was on that made it, where the client said so.
        solo: names of sources of light that alone are shown; None: all.
        room_revision: how often a room's look had changed by then; 0 where nobody shares it.
    """

    look: Any
    document: dict[str, Any]
    revision: int
    received_s: float | None
    active_pointer: str | None = None
    solo: frozenset[str] | None = None
    room_revision: int = 0
    applied_s: float = 0.0


@dataclass(frozen=True)
class CameraState:
    """Where a moving view is to be seen from.

    Attributes:
        seq: that frames name. size: of their pictures, pixels. received_s: when it came in.
        is_idle: an exact picture is to follow when nothing else is left to do.
    """

    seq: int
    camera: Camera
    size: tuple[int, int]
    received_s: float
    is_idle: bool
