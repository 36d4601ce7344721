"""One live session from hello to the last word: puts the parts together and ends them together."""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from starlette.websockets import WebSocket, WebSocketDisconnect

from relume.errors import RelumeError
from relume.picture.transfer import AnyView, Eyes, Opened
from server.access.access import PROXY_AGAIN_S, Access
from server.access.audit import Audit
from server.errors import CLOSE_NORMAL, ElsewhereError, LoginError, close_code_of, problem_of, row_of
from server.library.ports import Library
from server.library.threads import Threads
from server.live.edit_notes import EditNotes
from server.live.reception import Reception
from server.live.rooms.guest import Guest, Place
from server.live.rooms.keeper import Keeper
from server.live.rooms.rooms import Rooms
from server.live.sending.bake_news import BakeNews
from server.live.sending.frame_loop import FrameLoop
from server.live.session_state import SessionState
from server.live.state.client_socket import ClientSocket
from server.live.state.frame_window import FrameWindow
from server.live.state.look_state import LookState
from server.live.state.pending_requests import PendingRequests
from server.live.state.resume import Kept, ResumeStore
from server.live.state.shown_views import ShownViews
from server.live.visit import Visit
from server.logs.context import BAKE, SESSION
from server.metrics import Metrics
from server.running.leave import Leave
from server.traces import Traces
from server.wire.connection import LeavingMessage
from server.wire.protocol import CameraInfo, HelloMessage, MovingError, ViewInfo
from worker.database.faults import AWAY, told

if TYPE_CHECKING:
    from relume.methods.moving_views import MovingViews
    from relume.moving.view import FreeView

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SessionServices:
    """What all sessions share."""

    library: Library
    threads: Threads
    metrics: Metrics
    traces: Traces | None
    resumes: ResumeStore
    rooms: Rooms
    keeper: Keeper
    bake_news: BakeNews
    access: Access
    leave: Leave
    ack_seconds: float
    drain_seconds: float


async def serve(services: SessionServices, websocket: WebSocket, bake: str, transfer: Opened, visit: Visit) -> None:
    """Serve an accepted WebSocket until one side ends it; what the client had is kept for a resume."""
    kept = services.resumes.take(visit.resume, bake, time.monotonic()) if visit.resume else None
    begun = kept.document if kept else visit.look or transfer.default_look
    place = _enter(services, transfer.scene_id, visit, begun, has_own=kept is not None)
    session = secrets.token_hex(8)
    notes = _notes(services.access.audit, visit, bake, session)
    state = _state(services, websocket, transfer, visit, kept, begun if place is None else place.document, place, notes)
    token = services.resumes.open(bake, state.look, state.shown)
    SESSION.set(session)
    BAKE.set(bake)
    services.metrics.sessions.inc()
    is_for_good = False
    try:
        await state.socket.send(_hello(session, bake, state, token, kept is not None))
        await _run(services, websocket, bake, state)
    except WebSocketDisconnect as gone:
        is_for_good = gone.code == CLOSE_NORMAL
        log.debug("session of bake %s: the client left", bake)
    except (RelumeError, OSError, *AWAY) as error:
        if row_of(error).status >= 500:
            log.error("session of bake %s ends (%s)", bake, told(error))
        await state.socket.close(close_code_of(error), problem_of(error).detail)
    except Exception as error:
        log.exception("session of bake %s ends by a defect", bake)
        await state.socket.close(close_code_of(error), problem_of(error).detail)
    finally:
        services.metrics.sessions.dec()
        if state.guest is not None:
            state.guest.leave(is_for_good=is_for_good)
        services.resumes.close(token, time.monotonic())
        if notes is not None:
            await notes.write()


def _enter(
    services: SessionServices, scene: str, visit: Visit, begun: dict[str, Any], *, has_own: bool
) -> Place | None:
    """Into the room that was asked for; None where none was."""
    if visit.door is None:
        return None
    return services.rooms.enter(visit.door, scene, visit.caller, begun, has_own=has_own)


def _state(
    services: SessionServices, websocket: WebSocket, transfer: Opened, visit: Visit, kept: Kept | None,
    document: dict[str, Any], place: Place | None, notes: EditNotes | None,
) -> SessionState:  # fmt: skip
    """What the halves of the session begin with: what was kept of a lost one, and this look."""
    default = transfer.default_look
    look = LookState(default, document, kept.revision, kept.solo) if kept else LookState(default, document, 0)
    first = next(iter(transfer.views))
    shown = ShownViews(kept.views, kept.focus) if kept else ShownViews([first], first)
    pending = PendingRequests(look.target(0 if place is None else place.room.num_changes))
    guest = None if place is None else Guest(place, look, pending, may_edit=visit.caller.may_edit)
    socket, window = ClientSocket(websocket, services.ack_seconds), FrameWindow(services.ack_seconds)
    of_all = services.metrics, services.traces
    return SessionState(socket, pending, shown, window, look, transfer, *of_all, visit.caller, guest, notes)


def _notes(audit: Audit, visit: Visit, bake: str, session: str) -> EditNotes | None:
    if not visit.caller.may_edit:
        return None
    room = "" if visit.door is None else f", room {visit.door.prefix}…"  # enough to know it by, not to open it
    return EditNotes(audit, visit.caller, f"/api/bakes/{bake}/session, {session}{room}")


def _hello(session: str, bake: str, state: SessionState, token: str, resumed: bool) -> HelloMessage:
    transfer, look, shown = state.transfer, state.look, state.shown
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
        view=shown.focus,
        shown=list(shown.names),
        views=views,
        materials=list(transfer.material_names),
        resume=token,
        role=state.caller.role.word,
        room=None if state.guest is None else state.guest.info(),
        moving_error=_moving_error(transfer),
    )


def _moving_error(transfer: Opened) -> MovingError | None:
    if transfer.eyes is not Eyes.FREE:
        return None
    found = cast("MovingViews", transfer).moving_error
    return None if found is None else MovingError(value=found.value, standard_error=found.standard_error)


def _view_info(view: AnyView, transfer: Opened) -> ViewInfo:
    camera = CameraInfo(to_world=view.camera.to_world.ravel().tolist(), yfov=view.camera.yfov)
    bounds = None
    if transfer.eyes is Eyes.FREE:
        lowest, highest = cast("FreeView", view).bounds
        bounds = lowest.tolist(), highest.tolist()
    eye = transfer.eyes.value
    return ViewInfo(name=view.name, width=view.width, height=view.height, camera=camera, eye=eye, bounds=bounds)


async def _run(services: SessionServices, websocket: WebSocket, bake: str, state: SessionState) -> None:
    """Run all parts, and a watch on the token, until one of them ends; raise what ended it."""
    tasks = [
        asyncio.create_task(Reception(websocket, state).run()),
        asyncio.create_task(FrameLoop(state, services.library, services.threads).run()),
        asyncio.create_task(services.bake_news.tell(state.socket, bake, state.transfer.scene_id)),
        asyncio.create_task(services.access.until_revoked(state.caller)),
        asyncio.create_task(_say_goodbye(services, state.socket)),
    ]
    if state.caller.by == "proxy":
        tasks.append(asyncio.create_task(_send_by_the_proxy(services, state.socket)))
    if state.notes is not None:
        tasks.append(asyncio.create_task(state.notes.run()))
    if state.guest is not None:
        tasks.append(asyncio.create_task(state.guest.tell(state.socket)))
        tasks.append(asyncio.create_task(_send_after(services, state.guest, state.socket)))
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        await _end(tasks)


async def _say_goodbye(services: SessionServices, socket: ClientSocket) -> None:
    """Tell the client when the server takes leave; it goes when it likes to."""
    await services.leave.taken()
    await socket.send(LeavingMessage(seconds=services.drain_seconds))
    await asyncio.Event().wait()


async def _send_by_the_proxy(services: SessionServices, socket: ClientSocket) -> None:
    """Have a client whom a proxy named come by it again. Raises LoginError if it does not go."""
    await asyncio.sleep(PROXY_AGAIN_S)
    await socket.send(LeavingMessage(seconds=services.drain_seconds))
    await asyncio.sleep(services.drain_seconds)
    raise LoginError("the proxy that named you has to do so again; open the session again")


async def _send_after(services: SessionServices, guest: Guest, socket: ClientSocket) -> None:
    """Send the client after its room when another server has it. Raises ElsewhereError where it does not go."""
    await guest.lost()
    await socket.send(LeavingMessage(seconds=services.drain_seconds))
    await asyncio.sleep(services.drain_seconds)
    raise ElsewhereError("another server has this room; open the session again")


async def _end(tasks: Sequence[asyncio.Task[None]]) -> None:
    """Cancel the tasks and see them end, even while being cancelled: a thread may still use the picture."""
    cancelled: asyncio.CancelledError | None = None
    for task in tasks:
        task.cancel()
    while not all(task.done() for task in tasks):
        try:
            await asyncio.wait(tasks)
        except asyncio.CancelledError as error:
            cancelled = error
    for task in tasks:
        if not task.cancelled():
            task.exception()  # one that lost the race to end the session is not told
    if cancelled is not None:
        raise cancelled
