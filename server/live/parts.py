"""What the two halves of a session have in common."""

from __future__ import annotations

from dataclasses import dataclass

from server.live.edits import LookDesk
from server.live.ports import Transfer
from server.live.shown import Shown
from server.live.window import Window
from server.live.wire import Wire
from server.live.wishes import Wishes
from server.metrics import Metrics


@dataclass(frozen=True)
class Parts:
    """The receiving half fills them, the sending half follows; all on the event loop."""

    wire: Wire
    wishes: Wishes
    shown: Shown
    window: Window
    desk: LookDesk
    transfer: Transfer
    metrics: Metrics
