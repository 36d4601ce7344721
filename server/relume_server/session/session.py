"""One live session, from hello to close: connects its parts and ends them together."""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from fastapi.concurrency import run_in_threadpool
from starlette.websockets import WebSocket, WebSocketDisconnect

from relume.core.errors import RelumeError
from relume.live.fixed_camera.protocols import CameraMode, CameraView, OpenBake
from relume.scene.model import Camera
from relume_server.auth.audit import Audit
from relume_server.auth.services import PROXY_REVALIDATION_S, AuthServices
from relume_server.client_state.flow_control import FrameWindow
from relume_server.client_state.look_state import LookState
from relume_server.client_state.pending_requests import PendingRequests
from relume_server.client_state.resume import ResumeStore, SavedSession
from relume_server.client_state.socket import ClientSocket
from relume_server.client_state.visible_views import VisibleViews
from relume_server.collaboration.member import RoomEntry, RoomMember
from relume_server.collaboration.room_lease import RoomLease
from relume_server.collaboration.rooms import Rooms
from relume_server.errors import CLOSE_NORMAL, LoginError, OtherServerError, find_close_code, find_mapping, make_problem
from relume_server.lifecycle.drain import DrainState
from relume_server.runtime.executors import Threads
from relume_server.runtime.protocols import Library
from relume_server.schemas.connection import DrainMessage
from relume_server.schemas.protocol import CameraInfo, FreeCameraError, HelloMessage, ViewInfo
from relume_server.session.audit_edits import AuditWriter
from relume_server.session.frames.bake_updates import BakeUpdates
from relume_server.session.frames.frame_loop import FrameLoop
from relume_server.session.join_context import JoinContext
from relume_server.session.receive import MessageReceiver
from relume_server.session.session_state import SessionState
from relume_server.telemetry.logs.context import BAKE, SESSION
from relume_server.telemetry.metrics import Metrics
from relume_server.telemetry.traces import Traces
from relume_worker.database.failures import DATABASE_ERRORS, describe_error

if TYPE_CHECKING:
    from relume.live.free_camera.free_view import FreeView
    from relume.live.free_camera.protocol import FreeCameraTransfer
    from relume.live.opened.free_camera_transfer import BakedFreeCamera

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SessionServices:
    """Services shared by all sessions."""

    library: Library
    threads: Threads
    metrics: Metrics
    traces: Traces | None
    resumes: ResumeStore
    rooms: Rooms
    room_lease: RoomLease
    bake_updates: BakeUpdates
    access: AuthServices
    drain: DrainState
    ack_seconds: float
    drain_seconds: float


async def serve(
    services: SessionServices, websocket: WebSocket, bake: str, transfer: OpenBake, context: JoinContext
) -> None:
    """Serve an accepted WebSocket until one side ends it; its state is kept for a resume."""
    saved = services.resumes.take(context.resume, bake, time.monotonic()) if context.resume else None
    initial_document = saved.document if saved else context.look or transfer.default_look
    room_entry = _enter_room(
        services, transfer.scene_id, context, initial_document, has_local_settings=saved is not None
    )
    session = secrets.token_hex(8)
    audit_writer = _audit_writer(services.access.audit, context, bake, session)
    state = _state(
        services,
        websocket,
        transfer,
        context,
        saved,
        initial_document if room_entry is None else room_entry.document,
        room_entry,
        audit_writer,
    )
    token = services.resumes.open(bake, state.look, state.visible_views)
    SESSION.set(session)
    BAKE.set(bake)
    services.metrics.sessions.inc()
    is_for_good = False
    try:
        hello = await run_in_threadpool(_hello, session, bake, state, token, saved is not None)  # may trace rays
        await state.socket.send(hello)
        await _run(services, websocket, bake, state)
    except WebSocketDisconnect as gone:
        is_for_good = gone.code == CLOSE_NORMAL
        log.debug("session of bake %s: the client left", bake)
    except (RelumeError, OSError, *DATABASE_ERRORS) as error:
        if find_mapping(error).status >= 500:
            log.error("session of bake %s ends (%s)", bake, describe_error(error))
        await state.socket.close(find_close_code(error), make_problem(error).detail)
    except Exception as error:
        log.exception("session of bake %s ends with an internal error", bake)
        await state.socket.close(find_close_code(error), make_problem(error).detail)
    finally:
        services.metrics.sessions.dec()
        if state.member is not None:
            state.member.leave(is_for_good=is_for_good)
        services.resumes.close(token, time.monotonic())
        if audit_writer is not None:
            await audit_writer.write()


def _enter_room(
    services: SessionServices,
    scene: str,
    context: JoinContext,
    initial_document: dict[str, Any],
    *,
    has_local_settings: bool,
) -> RoomEntry | None:
    """Join the requested room; None without a room."""
    if context.join_request is None:
        return None
    return services.rooms.enter(
        context.join_request, scene, context.caller, initial_document, has_local_settings=has_local_settings
    )


def _state(
    services: SessionServices, websocket: WebSocket, transfer: OpenBake, context: JoinContext,
    saved: SavedSession | None, document: dict[str, Any], room_entry: RoomEntry | None,
    audit_writer: AuditWriter | None,
) -> SessionState:  # fmt: skip
    """Create the state of a session: from a lost session, or with this look."""
    default = transfer.default_look
    look = LookState(default, document, saved.revision, saved.solo) if saved else LookState(default, document, 0)
    first = next(iter(transfer.views))
    visible_views = VisibleViews(saved.views, saved.focus) if saved else VisibleViews([first], first)
    pending = PendingRequests(look.target(0 if room_entry is None else room_entry.room.num_changes))
    member = None if room_entry is None else RoomMember(room_entry, look, pending, may_edit=context.caller.may_edit)
    socket, window = ClientSocket(websocket, services.ack_seconds), FrameWindow(services.ack_seconds)
    telemetry = services.metrics, services.traces
    return SessionState(
        socket, pending, visible_views, window, look, transfer, *telemetry, context.caller, member, audit_writer
    )


def _audit_writer(audit: Audit, context: JoinContext, bake: str, session: str) -> AuditWriter | None:
    if not context.caller.may_edit:
        return None
    # identifies the room, without giving access
    room = "" if context.join_request is None else f", room {context.join_request.prefix}…"
    return AuditWriter(audit, context.caller, f"/api/bakes/{bake}/session, {session}{room}")


def _hello(session: str, bake: str, state: SessionState, token: str, resumed: bool) -> HelloMessage:
    transfer, look, visible_views = state.transfer, state.look, state.visible_views
    views = [_view_info(view, transfer) for view in transfer.views.values()]
    return HelloMessage(
        session=session,
        bake=bake,
        method=transfer.method,
        axes=sorted(axis.value for axis in transfer.axes),
        scene=transfer.scene_id,
        look=look.document,
        solo=None if look.solo is None else sorted(look.solo),
        revision=look.revision,
        resumed=resumed,
        focused_view=visible_views.focus,
        visible_views=list(visible_views.names),
        views=views,
        materials=list(transfer.material_names),
        resume=token,
        role=state.caller.role.label,
        room=None if state.member is None else state.member.info(),
        free_camera_error=_free_camera_error(transfer),
    )


def _free_camera_error(transfer: OpenBake) -> FreeCameraError | None:
    if transfer.camera_mode is not CameraMode.FREE:
        return None
    error = cast("BakedFreeCamera", transfer).free_camera_error
    if error is None:
        return None
    return FreeCameraError(
        delta_e=error.delta_e.value,
        rms=error.rms.value,
        delta_e_standard_error=error.delta_e.standard_error,
        rms_standard_error=error.rms.standard_error,
    )


def _view_info(view: CameraView, transfer: OpenBake) -> ViewInfo:
    bounds = interior = None
    if transfer.camera_mode is CameraMode.FREE:
        lowest, highest = cast("FreeView", view).bounds
        bounds = lowest.tolist(), highest.tolist()
        interior = cast("FreeCameraTransfer", transfer).interior_camera
    return ViewInfo(
        name=view.name,
        width=view.width,
        height=view.height,
        camera=_camera_info(view.camera),
        camera_mode=transfer.camera_mode.value,
        bounds=bounds,
        interior_camera=None if interior is None else _camera_info(interior),
    )


def _camera_info(camera: Camera) -> CameraInfo:
    return CameraInfo(to_world=camera.to_world.ravel().tolist(), yfov=camera.yfov, near=camera.near)


async def _run(services: SessionServices, websocket: WebSocket, bake: str, state: SessionState) -> None:
    """Run all parts, and a check of the token, until one of them ends; raise its exception."""
    tasks = [
        asyncio.create_task(MessageReceiver(websocket, state).run()),
        asyncio.create_task(FrameLoop(state, services.library, services.threads).run()),
        asyncio.create_task(services.bake_updates.send_updates(state.socket, bake, state.transfer.scene_id)),
        asyncio.create_task(services.access.until_revoked(state.caller)),
        asyncio.create_task(_send_drain(services, state.socket)),
    ]
    if state.caller.auth_method == "proxy":
        tasks.append(asyncio.create_task(_require_proxy_login(services, state.socket)))
    if state.audit_writer is not None:
        tasks.append(asyncio.create_task(state.audit_writer.run()))
    if state.member is not None:
        tasks.append(asyncio.create_task(state.member.send_updates(state.socket)))
        tasks.append(asyncio.create_task(_redirect_to_room(services, state.member, state.socket)))
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        await _end(tasks)


async def _send_drain(services: SessionServices, socket: ClientSocket) -> None:
    """Notify the client when the server drains; the client leaves when it is ready."""
    await services.drain.wait()
    await socket.send(DrainMessage(seconds=services.drain_seconds))
    await asyncio.Event().wait()


async def _require_proxy_login(services: SessionServices, socket: ClientSocket) -> None:
    """Ask a client that a proxy named to connect again. Raises LoginError if it does not leave."""
    await asyncio.sleep(PROXY_REVALIDATION_S)
    await socket.send(DrainMessage(seconds=services.drain_seconds))
    await asyncio.sleep(services.drain_seconds)
    raise LoginError("the proxy's login must be renewed; open the session again")


async def _redirect_to_room(services: SessionServices, member: RoomMember, socket: ClientSocket) -> None:
    """Ask the client to follow its room when another server has it. Raises OtherServerError if it does not leave."""
    await member.wait_until_lost()
    await socket.send(DrainMessage(seconds=services.drain_seconds))
    await asyncio.sleep(services.drain_seconds)
    raise OtherServerError("another server has this room; open the session again")


async def _end(tasks: Sequence[asyncio.Task[None]]) -> None:
    """Cancel the tasks and wait for them, even while being canceled: a thread may still use the image."""
    is_canceled: asyncio.CancelledError | None = None
    for task in tasks:
        task.cancel()
    while not all(task.done() for task in tasks):
        try:
            await asyncio.wait(tasks)
        except asyncio.CancelledError as error:
            is_canceled = error
    for task in tasks:
        if not task.cancelled():
            task.exception()  # its error is not the one that ended the session
    if is_canceled is not None:
        raise is_canceled
