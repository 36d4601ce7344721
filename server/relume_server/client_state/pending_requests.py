"""What the client wants and has not got yet: one slot of each kind, the newest wins, so memory stays bounded."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import Literal

from relume_server.client_state.target import CameraState, Target
from relume_server.schemas.protocol import HighlightMessage, InspectMessage


@dataclass
class PendingRequests:
    """Filled by the receiving side, emptied by the frame loop; both on the event loop.

    Attributes:
        target: the newest look; it stays, each view is painted with it once.
        space: width and height that the client has for the view that it shows alone; None: as much as it is large.
        camera_states: newest eye of each view that has been given one; it stays.
        regions: what is on the client's screen of each view, where it has said so: x, y, width, height in pixels.
        renderer: who renders views whose camera moves.
        prepare_curve, active_parameter: pointers of a curve that was opened, of a parameter whose slider is in hand.
    """

    target: Target
    camera_states: dict[str, CameraState] = field(default_factory=dict)
    regions: dict[str, tuple[int, int, int, int]] = field(default_factory=dict)
    prepare_curve: str | None = None
    active_parameter: str | None = None
    inspect: InspectMessage | None = None
    highlight: HighlightMessage | None = None
    form: Literal["hdr", "jpeg", "auto"] = "auto"
    quality: int = 80
    renderer: Literal["client", "server"] = "server"
    space: tuple[int, int] | None = None
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    def pop_prepare(self) -> str | None:
        """Empty the touched curve's slot."""
        taken, self.prepare_curve = self.prepare_curve, None
        return taken

    def pop_active(self) -> str | None:
        """Empty the held parameter's slot."""
        taken, self.active_parameter = self.active_parameter, None
        return taken

    def pop_inspect(self) -> InspectMessage | None:
        """Empty the probe's slot."""
        taken, self.inspect = self.inspect, None
        return taken

    def pop_highlight(self) -> HighlightMessage | None:
        """Empty the brush's slot."""
        taken, self.highlight = self.highlight, None
        return taken
