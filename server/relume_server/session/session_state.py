"""State shared by the two halves of a session."""

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
    """Written by the receiver, read by the frame loop; all on the event loop.

    Attributes:
        traces: None if disabled. caller: the client. member: member of the room; None without a room.
        audit_writer: None for view-only clients, which change view settings only.
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
