"""What the client wants and has not got yet: one slot of each kind, the newest wins, so memory stays bounded."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import Literal

from server.live.state.target import Eye, Target
from server.wire.protocol import BrushMessage, ProbeMessage


@dataclass
class PendingRequests:
    """Filled by the receiving side, emptied by the frame loop; both on the event loop.

    Attributes:
        target: the newest look; it stays, each view is painted with it once.
        space: width and height that the client has for the view that it shows alone; None: as much as it is large.
        eyes: newest eye of each view that has been given one; it stays.
        regions: what is on the client's screen of each view, where it has said so: x, y, width, height in pixels.
        evaluator: who finds the pixels of views whose eye moves.
        touch, hold: pointers of a curve that was opened, of a parameter whose slider is in hand.
    """

    target: Target
    eyes: dict[str, Eye] = field(default_factory=dict)
    regions: dict[str, tuple[int, int, int, int]] = field(default_factory=dict)
    touch: str | None = None
    hold: str | None = None
    probe: ProbeMessage | None = None
    brush: BrushMessage | None = None
    form: Literal["hdr", "jpeg", "auto"] = "auto"
    quality: int = 80
    evaluator: Literal["browser", "server"] = "server"
    space: tuple[int, int] | None = None
    news: asyncio.Event = field(default_factory=asyncio.Event)

    def take_touch(self) -> str | None:
        """Empty the touched curve's slot."""
        taken, self.touch = self.touch, None
        return taken

    def take_hold(self) -> str | None:
        """Empty the held parameter's slot."""
        taken, self.hold = self.hold, None
        return taken

    def take_probe(self) -> ProbeMessage | None:
        """Empty the probe's slot."""
        taken, self.probe = self.probe, None
        return taken

    def take_brush(self) -> BrushMessage | None:
        """Empty the brush's slot."""
        taken, self.brush = self.brush, None
        return taken
