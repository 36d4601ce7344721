"""What the two halves of a session have in common."""

from __future__ import annotations

from dataclasses import dataclass

from relume.picture.transfer import OpenBake
from server.access.roles import Caller
from server.live.edit_notes import AuditWriter
from server.live.rooms.guest import RoomMember
from server.live.state.client_socket import ClientSocket
from server.live.state.frame_window import FrameWindow
from server.live.state.look_state import LookState
from server.live.state.pending_requests import PendingRequests
from server.live.state.shown_views import VisibleViews
from server.metrics import Metrics
from server.traces import Traces


@dataclass(frozen=True)
class SessionState:
    """The receiving half fills them, the sending half follows; all on the event loop.

    Attributes:
        traces: None where nobody wants any. caller: who is at the other end. member: the session in its room; None
            where nobody shares it. audit_writer: for the audit; None of who may not edit: theirs are ways of looking.
    """

    socket: ClientSocket
    pending: PendingRequests
    visible_views: VisibleViews
    window: FrameWindow
    look: LookState
    transfer: OpenBake
    metrics: Metrics
    traces: Traces | None
    caller: Caller
    member: RoomMember | None
    audit_writer: AuditWriter | None
