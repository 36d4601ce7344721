"""The live session's WebSocket: who may open one, on which bake, and how many at once."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.concurrency import run_in_threadpool
from starlette.websockets import WebSocket, WebSocketDisconnect

from relume.errors import NotFoundError, RelumeError, VersionMismatchError
from server.errors import CLOSE_PROTOCOL, BusyError, close_code_of, problem_of
from server.live.session import serve
from server.live.state.client_socket import ClientSocket
from server.routes.bakes import ready_bake
from server.services import Services
from server.wire.protocol import SUBPROTOCOL

router = APIRouter()


@router.websocket("/api/bakes/{bake}/session")
async def session(websocket: WebSocket, bake: str) -> None:
    """A live session; foreign pages were refused before. Refusals are said with a close code, so it accepts first."""
    services: Services = websocket.app.state.services
    is_ours = SUBPROTOCOL in websocket.scope["subprotocols"]
    await websocket.accept(subprotocol=SUBPROTOCOL if is_ours else None)
    socket = ClientSocket(websocket, services.settings.ack_seconds)
    try:
        if not is_ours:
            raise VersionMismatchError(f"this server speaks {SUBPROTOCOL}; reload the page", CLOSE_PROTOCOL)
        await _serve(services, websocket, bake)
    except WebSocketDisconnect:
        return
    except (RelumeError, OSError) as error:
        await socket.close(close_code_of(error), problem_of(error).detail)


async def _serve(services: Services, websocket: WebSocket, bake: str) -> None:
    if not services.session_slots.acquire(blocking=False):
        raise BusyError(f"{services.settings.max_sessions} sessions are open; close one and try again")
    try:
        status = await run_in_threadpool(ready_bake, services, bake)
        async with services.transfers.using(status.id, services.bakes.store_path(status.id)) as transfer:
            if not transfer.views:
                raise NotFoundError("this bake has no views; bake again")
            await serve(services.live, websocket, status.id, transfer, websocket.query_params.get("resume"))
    finally:
        services.session_slots.release()
