"""What the two halves of a session have in common."""

from __future__ import annotations

from dataclasses import dataclass

from relume.picture.transfer import Opened
from server.access.roles import Caller
from server.live.edit_notes import EditNotes
from server.live.rooms.guest import Guest
from server.live.state.client_socket import ClientSocket
from server.live.state.frame_window import FrameWindow
from server.live.state.look_state import LookState
from server.live.state.pending_requests import PendingRequests
from server.live.state.shown_views import ShownViews
from server.metrics import Metrics
from server.traces import Traces


@dataclass(frozen=True)
class SessionState:
    """The receiving half fills them, the sending half follows; all on the event loop.

    Attributes:
        traces: None where nobody wants any. caller: who is at the other end. guest: the session in its room; None where
            nobody shares it. notes: for the audit; None of who may not edit: theirs are ways of looking.
    """

    socket: ClientSocket
    pending: PendingRequests
    shown: ShownViews
    window: FrameWindow
    look: LookState
    transfer: Opened
    metrics: Metrics
    traces: Traces | None
    caller: Caller
    guest: Guest | None
    notes: EditNotes | None
