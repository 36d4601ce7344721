"""The receiving half of a session: reads messages, checks them, and notes what the client wants."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

from starlette.websockets import WebSocket

from relume.errors import ParameterError, ProtocolError, RelumeError
from relume.picture.transfer import Eyes
from relume.scene.placed_camera import placed_camera
from server.access.rules import check_message
from server.errors import CLOSE_POLICY
from server.live.pace import Pace
from server.live.reading import read_message
from server.live.rooms.room import is_own_way
from server.live.session_state import SessionState
from server.live.state.pointers import check_held, find_curve
from server.live.state.target import Eye
from server.wire import protocol
from server.wire.connection import OpenMessage, PingMessage, PongMessage
from server.wire.rooms import PresenceMessage

MAX_BAD_MESSAGES = 50


class Reception:
    """Runs until the client goes or breaks the rules too often."""

    def __init__(self, websocket: WebSocket, state: SessionState) -> None:
        self._websocket, self._socket, self._pending, self._shown = websocket, state.socket, state.pending, state.shown
        self._window, self._look, self._transfer = state.window, state.look, state.transfer
        self._metrics, self._traces = state.metrics, state.traces
        self._caller, self._guest, self._notes = state.caller, state.guest, state.notes
        self._num_bad = 0

    async def run(self) -> None:
        """Receive for ever.

        Raises:
            WebSocketDisconnect: the client is gone.
            ProtocolError: the session must end; carries the close code.
        """
        pace = Pace()
        while True:
            received = await self._websocket.receive()
            received_s = time.perf_counter()
            num_in_flight = self._window.num_in_flight
            pace.begin()
            await self._answer(received, received_s)
            await pace.pause(is_due=self._window.num_in_flight < num_in_flight)

    async def _answer(self, received: Any, received_s: float) -> None:
        """Do what a message asks, or say why not."""
        message = read_message(received)
        if isinstance(message, protocol.Problem):
            await self._bad(message)
            return
        if isinstance(message, PingMessage):  # from here, so that no frame is waited for
            await self._socket.send(PongMessage())
            return
        try:
            self._take(message, received_s)
        except RelumeError as error:
            revision = message.revision if isinstance(message, protocol.EditMessage) else None
            await self._socket.refuse(error, revision)
        else:
            self._pending.news.set()

    async def _bad(self, problem: protocol.Problem) -> None:
        """A message that no client of ours sends: said each time, forgiven a number of times."""
        self._num_bad += 1
        if self._num_bad > MAX_BAD_MESSAGES:
            raise ProtocolError("too many messages that cannot be understood; reload the page", CLOSE_POLICY)
        await self._socket.refuse(problem)

    def _take(self, message: protocol.ClientMessage, received_s: float) -> None:
        check_message(self._caller, _kind(message))
        match message:
            case protocol.EditMessage():
                self._edit(message, received_s)
            case protocol.AckMessage():
                self._window.acknowledged(message.frame, received_s)
            case protocol.ViewMessage():
                self._show([message.name], message.size)
            case protocol.ViewsMessage():
                self._show(message.names, None)
            case protocol.FocusMessage():
                self._shown.work_in(message.view)
            case protocol.RegionMessage():
                self._look_at(message)
            case protocol.StreamMessage():
                self._pending.form, self._pending.quality = message.format, message.quality
            case protocol.ProbeMessage():
                self._shown.check(message.view or self._shown.focus)
                self._pending.probe = message
            case protocol.BrushMessage():
                find_curve(message.curve, self._look.document)
                self._pending.brush = message
            case protocol.TouchMessage():
                self._touch(message)
            case protocol.EyeMessage():
                self._see_from(message, received_s)
            case protocol.EvaluateMessage():
                self._pending.evaluator = message.by
            case PresenceMessage():
                self._present(message)
            case OpenMessage():
                raise ProtocolError("the session is open; send open once, as the first message", CLOSE_POLICY)

    def _present(self, message: PresenceMessage) -> None:
        if self._guest is None:
            raise ProtocolError("nobody shares this session; open one with a room to work together", CLOSE_POLICY)
        self._guest.present(message, self._caller.person)

    def _touch(self, message: protocol.TouchMessage) -> None:
        if message.curve is not None:
            find_curve(message.curve, self._look.document)
            self._pending.touch = message.curve
        elif message.parameter is not None:
            check_held(message.parameter, self._look.document)
            self._pending.hold = message.parameter

    def _edit(self, message: protocol.EditMessage, received_s: float) -> None:
        try:
            target = self._look.apply(message, received_s)
        except RelumeError as error:
            self._metrics.edits.labels("refused").inc()
            if self._traces is not None:
                self._traces.refused(received_s, str(error), {"revision": message.revision})
            raise
        if self._guest is not None:
            patch = [operation.model_dump(exclude_unset=True) for operation in message.patch]
            target = self._guest.edited(target, patch)
        self._pending.target = target
        if self._notes is not None:
            self._notes.note(operation.path for operation in message.patch)
        self._metrics.edits.labels("applied").inc()

    def _see_from(self, message: protocol.EyeMessage, received_s: float) -> None:
        """Take note of an eye; a number that is not newer than the last says nothing."""
        if self._transfer.eyes is not Eyes.FREE:
            raise ParameterError("view", message.view, "a view whose eye is free; bake the scene by method surface")
        self._check_view(message.view)
        width, height = message.size
        if not (width >= 1 and height >= 1 and width * height <= protocol.MAX_EYE_PIXELS):
            allowed = f"at least 1×1 pixels, at most {protocol.MAX_EYE_PIXELS} in all"
            raise ParameterError("size", list(message.size), allowed)
        camera = placed_camera("eye", message.to_world, math.degrees(message.yfov)).camera
        known = self._pending.eyes.get(message.view)
        if known is None or message.eye > known.number:
            self._pending.eyes[message.view] = Eye(
                message.eye, camera, message.size, received_s, message.rest == "exact"
            )

    def _look_at(self, message: protocol.RegionMessage) -> None:
        """Take note of what is on the screen of a view."""
        self._check_view(message.view)
        if self._transfer.eyes is Eyes.FREE:
            raise ParameterError("view", message.view, "a view whose eye is baked")
        if message.rect is None:
            self._pending.regions.pop(message.view, None)
            return
        (x, y, _, _), view = message.rect, self._transfer.views[message.view]
        if not (x < view.width and y < view.height):
            raise ParameterError("rect", list(message.rect), f"some of the picture's {view.width}×{view.height} pixels")
        self._pending.regions[message.view] = message.rect

    def _check_view(self, name: str) -> None:
        if name not in self._transfer.views:
            raise ParameterError("view", name, "one of " + ", ".join(sorted(self._transfer.views))[:400])

    def _show(self, names: Sequence[str], space: tuple[int, int] | None) -> None:
        for name in names:
            self._check_view(name)
        self._shown.show(names)
        self._pending.space = space


def _kind(message: protocol.ClientMessage) -> str:
    """What a message is to the table of roles."""
    match message:
        case protocol.EditMessage(patch=patch, hand=hand) if all(
            is_own_way(path) for path in (*(operation.path for operation in patch), *((hand,) if hand else ()))
        ):
            return "seen"
        case protocol.TouchMessage(curve=None):
            return "hold"
    return message.type
