"""The look that a session should show, and the time of its request."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relume.scene.model import Camera


@dataclass(frozen=True)
class Target:
    """A requested look.

    Attributes:
        look: validated. document: the same as JSON.
        received_s: time of the edit; None for a look without an edit. applied_s: time when it was applied.
        active_pointer: pointer of the active control that made it, if the client sent it.
        solo: names of the lights that are shown alone; None: all.
        room_revision: number of changes of the room's look so far; 0 without a room.
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
    """Requested camera of a free-camera view.

    Attributes:
        seq: repeated in frames. size: size of the image, pixels. received_s: time of the message.
        is_idle: an exact image follows when nothing else is left to do.
    """

    seq: int
    camera: Camera
    size: tuple[int, int]
    received_s: float
    is_idle: bool
