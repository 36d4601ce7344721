"""What the two halves of a session have in common."""

from __future__ import annotations

from dataclasses import dataclass

from relume.live.fixed_camera.protocols import OpenBake
from relume_server.auth.roles import Caller
from relume_server.client_state.flow_control import FrameWindow
from relume_server.client_state.look_state import LookState
from relume_server.client_state.pending_requests import PendingRequests
from relume_server.client_state.socket import ClientSocket
from relume_server.client_state.visible_views import VisibleViews
from relume_server.collaboration.member import RoomMember
from relume_server.session.audit_edits import AuditWriter
from relume_server.telemetry.metrics import Metrics
from relume_server.telemetry.traces import Traces


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
