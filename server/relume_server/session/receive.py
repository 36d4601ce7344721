"""Receiving half of a session: reads and validates messages, and stores the client's requests."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray
from starlette.websockets import WebSocket

from relume.core.errors import ParameterError, ProtocolError, RelumeError
from relume.live.fixed_camera.protocols import CameraMode
from relume.scene.custom_camera import make_custom_camera
from relume_server.auth.rules import check_message
from relume_server.client_state.pointers import check_parameter, find_curve
from relume_server.client_state.target import CameraState
from relume_server.collaboration.room import is_local_setting
from relume_server.errors import CLOSE_POLICY
from relume_server.schemas import protocol
from relume_server.schemas.connection import OpenMessage, PingMessage, PongMessage
from relume_server.schemas.rooms import PresenceMessage
from relume_server.session.message_rate import MessageRateLimit
from relume_server.session.reader import read_message
from relume_server.session.session_state import SessionState

if TYPE_CHECKING:
    from relume.live.free_camera.protocol import FreeCameraTransfer

MAX_BAD_MESSAGES = 50


class MessageReceiver:
    """Runs until the client leaves, or breaks the protocol too often."""

    def __init__(self, websocket: WebSocket, state: SessionState) -> None:
        self._websocket, self._socket, self._pending, self._visible_views = (
            websocket,
            state.socket,
            state.pending,
            state.visible_views,
        )
        self._window, self._look, self._transfer = state.window, state.look, state.transfer
        self._metrics, self._traces = state.metrics, state.traces
        self._caller, self._member, self._audit_writer = state.caller, state.member, state.audit_writer
        self._num_bad = 0

    async def run(self) -> None:
        """Receive forever.

        Raises:
            WebSocketDisconnect: the client is gone.
            ProtocolError: the session must end; carries the close code.
        """
        rate_limit = MessageRateLimit()
        while True:
            received = await self._websocket.receive()
            received_s = time.perf_counter()
            num_in_flight = self._window.num_in_flight
            rate_limit.start_message()
            await self._answer(received, received_s)
            await rate_limit.pause(is_due=self._window.num_in_flight < num_in_flight)

    async def _answer(self, received: Any, received_s: float) -> None:
        """Handle a message, or answer with a problem."""
        message = read_message(received)
        if isinstance(message, protocol.Problem):
            await self._refuse_malformed(message)
            return
        if isinstance(message, PingMessage):  # answered here, without waiting for a frame
            await self._socket.send(PongMessage())
            return
        try:
            if isinstance(message, protocol.PathMessage):
                await self._socket.send(self._first_obstacle(message))
                return
            self._dispatch(message, received_s)
        except RelumeError as error:
            revision = message.revision if isinstance(message, protocol.EditMessage) else None
            await self._socket.refuse(error, revision)
        else:
            self._pending.changed.set()

    async def _refuse_malformed(self, problem: protocol.Problem) -> None:
        """Answer an invalid message; a limited number is tolerated."""
        self._num_bad += 1
        if self._num_bad > MAX_BAD_MESSAGES:
            raise ProtocolError("this session sent too many invalid messages; reload the page", CLOSE_POLICY)
        await self._socket.refuse(problem)

    def _dispatch(self, message: protocol.ClientMessage, received_s: float) -> None:
        check_message(self._caller, _permission_key(message))
        match message:
            case protocol.EditMessage():
                self._edit(message, received_s)
            case protocol.AckMessage():
                self._window.on_acknowledged(message.frame, received_s)
            case protocol.ViewMessage():
                self._show_views([message.name], message.size)
            case protocol.ViewsMessage():
                self._show_views(message.names, None)
            case protocol.FocusMessage():
                self._visible_views.set_focus(message.view)
            case protocol.RegionMessage():
                self._look_at(message)
            case protocol.EncodingMessage():
                self._pending.form, self._pending.quality = message.format, message.quality
            case protocol.InspectMessage():
                self._visible_views.check(message.view or self._visible_views.focus)
                self._pending.inspect = message
            case protocol.HighlightMessage():
                find_curve(message.curve, self._look.document)
                self._pending.highlight = message
            case protocol.PrepareMessage():
                self._prepare(message)
            case protocol.CameraMessage():
                self._set_camera(message, received_s)
            case protocol.RendererMessage():
                self._pending.renderer = message.renderer
            case PresenceMessage():
                self._update_presence(message)
            case OpenMessage():
                raise ProtocolError("the session is open; send open once, as the first message", CLOSE_POLICY)

    def _update_presence(self, message: PresenceMessage) -> None:
        if self._member is None:
            raise ProtocolError("this session has no room; open one with a room to share it", CLOSE_POLICY)
        self._member.update_presence(message, self._caller.person)

    def _prepare(self, message: protocol.PrepareMessage) -> None:
        if message.curve is not None:
            find_curve(message.curve, self._look.document)
            self._pending.prepare_curve = message.curve
        elif message.parameter is not None:
            check_parameter(message.parameter, self._look.document)
            self._pending.active_parameter = message.parameter

    def _edit(self, message: protocol.EditMessage, received_s: float) -> None:
        try:
            target = self._look.apply(message, received_s)
        except RelumeError as error:
            self._metrics.edits.labels("refused").inc()
            if self._traces is not None:
                self._traces.record_refusal(received_s, str(error), {"revision": message.revision})
            raise
        if self._member is not None:
            patch = [operation.model_dump(exclude_unset=True) for operation in message.patch]
            target = self._member.accepted(target, patch)
        self._pending.target = target
        if self._audit_writer is not None:
            self._audit_writer.add_edit(operation.path for operation in message.patch)
        self._metrics.edits.labels("applied").inc()

    def _first_obstacle(self, message: protocol.PathMessage) -> protocol.PathAnswer:
        """Trace a path here, without waiting for a frame: a few rays take less than a millisecond."""
        check_message(self._caller, message.type)
        if self._transfer.camera_mode is not CameraMode.FREE:
            raise ParameterError("path", message.id, "a path in a bake with a free camera")
        transfer, path = cast("FreeCameraTransfer", self._transfer), np.array(message.points, np.float64)
        obstacle, surroundings = transfer.first_obstacle(path), transfer.surroundings(path[-1])
        normals = transfer.stored_scene.face_normal
        return protocol.PathAnswer(
            id=message.id,
            length=None if obstacle is None else obstacle.length,
            material=None if obstacle is None else _material_name(transfer, obstacle.face),
            normal=None if obstacle is None else _triple(normals[obstacle.face]),
            solid=_material_name(transfer, surroundings.face) if surroundings.is_solid else None,
        )

    def _set_camera(self, message: protocol.CameraMessage, received_s: float) -> None:
        """Store a new camera; a `seq` that is not newer than the last is ignored."""
        if self._transfer.camera_mode is not CameraMode.FREE:
            raise ParameterError("view", message.view, "a view with a free camera, or bake with method probes")
        self._check_view(message.view)
        width, height = message.size
        if not (width >= 1 and height >= 1 and width * height <= protocol.MAX_CAMERA_PIXELS):
            allowed = f"at least 1×1 pixels, at most {protocol.MAX_CAMERA_PIXELS} in total"
            raise ParameterError("size", list(message.size), allowed)
        camera = make_custom_camera("camera", message.to_world, math.degrees(message.yfov), message.near).camera
        previous = self._pending.camera_states.get(message.view)
        if previous is None or message.seq > previous.seq:
            self._pending.camera_states[message.view] = CameraState(
                message.seq, camera, message.size, received_s, message.refine == "exact"
            )

    def _look_at(self, message: protocol.RegionMessage) -> None:
        """Store the visible region of a view."""
        self._check_view(message.view)
        if self._transfer.camera_mode is CameraMode.FREE:
            raise ParameterError("view", message.view, "a view with a fixed camera")
        if message.rect is None:
            self._pending.regions.pop(message.view, None)
            return
        (x, y, _, _), view = message.rect, self._transfer.views[message.view]
        if not (x < view.width and y < view.height):
            raise ParameterError(
                "rect", list(message.rect), f"a region of the image, {view.width}×{view.height} pixels"
            )
        self._pending.regions[message.view] = message.rect

    def _check_view(self, name: str) -> None:
        if name not in self._transfer.views:
            raise ParameterError("view", name, "one of " + ", ".join(sorted(self._transfer.views))[:400])

    def _show_views(self, names: Sequence[str], space: tuple[int, int] | None) -> None:
        for name in names:
            self._check_view(name)
        self._visible_views.show(names)
        self._pending.space = space


def _material_name(transfer: FreeCameraTransfer, face: int) -> str:
    return transfer.material_names[int(transfer.stored_scene.face_material[face])]


def _triple(vector: NDArray[np.float32]) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z


def _permission_key(message: protocol.ClientMessage) -> str:
    """Key of a message in the table of roles."""
    match message:
        case protocol.EditMessage(patch=patch, active_control=control) if all(
            is_local_setting(path)
            for path in (*(operation.path for operation in patch), *((control,) if control else ()))
        ):
            return "edit_local"
        case protocol.PrepareMessage(curve=None):
            return "prepare_parameter"
    return message.type
