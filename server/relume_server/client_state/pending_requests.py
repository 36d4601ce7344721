"""Pending requests of the client: one slot per kind, the newest wins, so memory is bounded."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import Literal

from relume_server.client_state.target import CameraState, Target
from relume_server.schemas.protocol import HighlightMessage, InspectMessage


@dataclass
class PendingRequests:
    """Filled by the receiver, emptied by the frame loop; both on the event loop.

    Attributes:
        target: newest look; kept, each view renders it once.
        space: width and height of the client's area for a single view; None: unlimited.
        camera_states: newest free camera of each view; kept.
        regions: visible region of each view, if set: x, y, width, height in pixels.
        renderer: the side that renders free-camera views while the camera moves.
        prepare_curve, active_parameter: pointers of the opened curve, and of the parameter that is dragged.
    """

    target: Target
    camera_states: dict[str, CameraState] = field(default_factory=dict)
    regions: dict[str, tuple[int, int, int, int]] = field(default_factory=dict)
    prepare_curve: str | None = None
    active_parameter: str | None = None
    inspect: InspectMessage | None = None
    highlight: HighlightMessage | None = None
    form: Literal["hdr", "jpeg", "png", "auto"] = "auto"
    quality: int = 80
    renderer: Literal["client", "server"] = "server"
    space: tuple[int, int] | None = None
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    def pop_prepare(self) -> str | None:
        """Take the pending curve."""
        taken, self.prepare_curve = self.prepare_curve, None
        return taken

    def pop_active(self) -> str | None:
        """Take the pending parameter."""
        taken, self.active_parameter = self.active_parameter, None
        return taken

    def pop_inspect(self) -> InspectMessage | None:
        """Take the pending pixel probe."""
        taken, self.inspect = self.inspect, None
        return taken

    def pop_highlight(self) -> HighlightMessage | None:
        """Take the pending highlight request."""
        taken, self.highlight = self.highlight, None
        return taken
