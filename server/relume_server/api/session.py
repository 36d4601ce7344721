"""WebSocket of the live session: authorization, bake, and the limit of sessions."""

from __future__ import annotations

import json
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from fastapi import APIRouter
from fastapi.concurrency import run_in_threadpool
from starlette.websockets import WebSocket, WebSocketDisconnect

from relume.core.errors import NotFoundError, RelumeError, VersionMismatchError
from relume.live.fixed_camera.protocols import OpenBake
from relume.look import complete
from relume_server.api.bakes import require_ready_bake
from relume_server.auth.roles import get_caller
from relume_server.client_state.socket import ClientSocket
from relume_server.collaboration.join import parse_join_request
from relume_server.errors import (
    CLOSE_PROTOCOL,
    DrainingError,
    OtherServerError,
    find_close_code,
    find_mapping,
    make_problem,
    problem_response,
)
from relume_server.persistence.look_store import check_name
from relume_server.schemas.protocol import SUBPROTOCOL
from relume_server.schemas.rooms import ROOM_PREFIX
from relume_server.services import Services
from relume_server.session.join_context import JoinContext
from relume_server.session.reader import read_opening
from relume_server.session.session import serve

router = APIRouter()
_PREFIX = re.compile(rf"[A-Za-z0-9_-]{{{ROOM_PREFIX}}}")


@router.websocket("/api/bakes/{bake}/session")
async def session(websocket: WebSocket, bake: str) -> None:
    """Run a live session; foreign origins were rejected before.

    A draining server answers 503, and one without the room 404, so that a load balancer tries the next server and the
    client notices nothing. All other refusals are close codes, so the WebSocket is accepted first.
    """
    services: Services = websocket.app.state.services
    try:
        services.drain.check()
        async with _holding_room(services, _room_prefix(websocket)):
            await _accept(services, websocket, bake)
    except (DrainingError, OtherServerError) as error:
        services.metrics.refused_sessions.labels(find_mapping(error).slug).inc()
        await websocket.send_denial_response(problem_response(make_problem(error)))


@asynccontextmanager
async def _holding_room(services: Services, prefix: str) -> AsyncIterator[None]:
    """Lease the rooms with that prefix, if any, for this server."""
    if not _PREFIX.fullmatch(prefix):  # refused with a close code after accepting
        yield
        return
    async with services.live.room_lease.hold(prefix):
        yield


def _room_prefix(websocket: WebSocket) -> str:
    """Room prefix in the URL: enough to find the room's server, not enough to join."""
    return str(websocket.query_params.get("room_prefix", ""))


async def _accept(services: Services, websocket: WebSocket, bake: str) -> None:
    speaks_protocol = SUBPROTOCOL in websocket.scope["subprotocols"]
    try:
        await websocket.accept(subprotocol=SUBPROTOCOL if speaks_protocol else None)
    except OSError:  # the client left while waiting
        return
    socket = ClientSocket(websocket, services.settings.ack_seconds)
    try:
        if not speaks_protocol:
            raise VersionMismatchError(f"this server speaks {SUBPROTOCOL}; reload the page", CLOSE_PROTOCOL)
        await _serve(services, websocket, bake)
    except WebSocketDisconnect:
        return
    except (RelumeError, OSError) as error:
        services.metrics.refused_sessions.labels(find_mapping(error).slug).inc()
        await socket.close(find_close_code(error), make_problem(error).detail)


async def _serve(services: Services, websocket: WebSocket, bake: str) -> None:
    caller = get_caller(websocket)
    with services.access.quotas.session(caller.name):
        opening = await read_opening(websocket)
        join_request = parse_join_request(opening, _room_prefix(websocket))
        status = await run_in_threadpool(require_ready_bake, services, bake)
        async with services.transfers.acquire(status.id, services.bakes.store_path(status.id)) as transfer:
            if not transfer.views:
                raise NotFoundError("this bake has no views; bake again")
            look = await run_in_threadpool(_look, services, transfer, opening.look, opening.share)
            caller = caller.watching() if join_request is not None and join_request.room is None else caller
            context = JoinContext(caller, opening.resume, look, join_request)
            await serve(services.live, websocket, status.id, transfer, context)


def _look(services: Services, transfer: OpenBake, name: str | None, share_id: str | None) -> dict[str, Any] | None:
    """Return the saved or shared look that the session starts with; the role view may see these, too."""
    if name is not None:
        return complete(json.loads(services.looks.get(check_name(name)).document), transfer.default_look)
    if share_id is not None:
        return complete(services.shares.get(share_id).document["look"], transfer.default_look)
    return None
