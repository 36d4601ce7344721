"""One live session from hello to the last word: puts the parts together and ends them together."""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from relume.errors import RelumeError
from server.errors import close_code_of, problem_of
from server.live.bake_news import BakeNews
from server.live.edits import LookDesk
from server.live.frame_loop import FrameLoop
from server.live.parts import Parts
from server.live.ports import Library, Transfer, View
from server.live.reception import Reception
from server.live.resume import ResumeStore
from server.live.shown import Shown
from server.live.threads import Threads
from server.live.window import Window
from server.live.wire import Wire
from server.live.wishes import Wishes
from server.metrics import Metrics
from server.protocol import CameraInfo, HelloMessage, ViewInfo

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class House:
    """What all sessions share."""

    library: Library
    threads: Threads
    metrics: Metrics
    resumes: ResumeStore
    bake_news: BakeNews
    ack_seconds: float


async def serve(house: House, websocket: WebSocket, bake: str, transfer: Transfer, resume: str | None) -> None:
    """Serve an accepted WebSocket until one side ends it; what the client had is kept for a resume."""
    kept = house.resumes.take(resume, bake, time.monotonic()) if resume else None
    default: dict[str, Any] = transfer.default_look
    desk = LookDesk(default, kept.document if kept else default, kept.revision if kept else 0)
    first = next(iter(transfer.views))
    shown = Shown(kept.views, kept.focus) if kept else Shown([first], first)
    wire = Wire(websocket, house.ack_seconds)
    window = Window(house.ack_seconds)
    parts = Parts(wire, Wishes(desk.target()), shown, window, desk, transfer, house.metrics)
    token = house.resumes.open(bake, desk, shown)
    house.metrics.sessions.inc()
    try:
        await wire.send(_hello(bake, transfer, desk, shown, token, kept is not None))
        await _run(house, websocket, bake, parts)
    except WebSocketDisconnect:
        log.debug("session of bake %s: the client left", bake)
    except RelumeError as error:
        await wire.close(close_code_of(error), problem_of(error).detail)
    except Exception as error:
        log.exception("session of bake %s ends by a defect", bake)
        await wire.close(close_code_of(error), problem_of(error).detail)
    finally:
        house.metrics.sessions.dec()
        house.resumes.close(token, time.monotonic())


def _hello(bake: str, transfer: Transfer, desk: LookDesk, shown: Shown, token: str, resumed: bool) -> HelloMessage:
    views = [_view_info(view) for view in transfer.views.values()]
    return HelloMessage(
        session=secrets.token_hex(8),
        bake=bake,
        method=transfer.method,
        scene=transfer.scene_id,
        look=desk.document,
        revision=desk.revision,
        resumed=resumed,
        view=shown.focus,
        shown=list(shown.names),
        views=views,
        materials=list(transfer.material_names),
        resume=token,
    )


def _view_info(view: View) -> ViewInfo:
    camera = CameraInfo(to_world=view.camera.to_world.ravel().tolist(), yfov=view.camera.yfov)
    return ViewInfo(name=view.name, width=view.width, height=view.height, camera=camera)


async def _run(house: House, websocket: WebSocket, bake: str, parts: Parts) -> None:
    """Run reception, frame loop and bake news until the first of them ends; raise what ended it."""
    tasks = [
        asyncio.create_task(Reception(websocket, parts).run()),
        asyncio.create_task(FrameLoop(parts, house.library, house.threads).run()),
        asyncio.create_task(house.bake_news.tell(parts.wire, bake, parts.transfer.scene_id)),
    ]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        await _end(tasks)


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
