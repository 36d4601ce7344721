"""Responses besides frames: the open curve, a pixel, the highlighted pixels of a curve."""

from __future__ import annotations

import time
from typing import Any

from relume.brdf.curves import curve_bands, generated_bands
from relume.core.errors import ParameterError, RelumeError
from relume_server.client_state.pointers import find_curve
from relume_server.client_state.socket import ClientSocket
from relume_server.client_state.target import Target
from relume_server.runtime.executors import SerialExecutor
from relume_server.schemas.protocol import CurveMessage, FrameHeader, HighlightMessage, InspectAnswer, InspectMessage
from relume_server.session.frames.painter import encode_highlight, pack, rounded, times
from relume_server.session.frames.viewport import Viewport


class QueryResponder:
    """Answers queries in the frame loop, between frames.

    Attributes:
        open_curve: pointer of the curve that the user has opened.
    """

    def __init__(self, socket: ClientSocket, work: SerialExecutor) -> None:
        self._socket, self._work = socket, work
        self.open_curve: str | None = None
        self._last_curve_key: dict[str, Any] | None = None

    def set_open_curve(self, pointer: str) -> None:
        """Set the open curve. It is sent again, because a client that closes a curve forgets it."""
        self.open_curve, self._last_curve_key = pointer, None

    async def send_curve(self, target: Target) -> None:
        """Send the open curve of this look, if its term has changed since it was last sent."""
        if self.open_curve is None:
            return
        try:
            term, curve = find_curve(self.open_curve, target.document)
        except ParameterError:  # removed by an edit
            self.open_curve = None
            return
        key = {"pointer": self.open_curve, "term": term}
        if key == self._last_curve_key:
            return
        displayed, generated = await self._work.run_short(
            lambda: (rounded(curve_bands(term, curve)), rounded(generated_bands(term, curve)))
        )
        await self._socket.send(
            CurveMessage(curve=self.open_curve, revision=target.revision, bands=displayed, generated=generated)
        )
        self._last_curve_key = key

    async def answer_inspect(self, viewport: Viewport, message: InspectMessage) -> None:
        """Answer a pixel probe."""
        try:
            await self._inspect(viewport, message)
        except RelumeError as error:
            await self._socket.refuse(error)

    async def answer_highlight(self, viewport: Viewport, frame: int, is_focused: bool) -> bytes | None:
        """Highlight frame of a view; only for the focused view a failure is reported."""
        message, viewport.highlight = viewport.highlight, None
        try:
            return None if message is None else await self._render_highlight(viewport, message, frame)
        except RelumeError as error:
            if is_focused:
                await self._socket.refuse(error)
            return None

    async def _inspect(self, viewport: Viewport, message: InspectMessage) -> None:
        width, height = viewport.size
        if message.x >= width or message.y >= height:
            raise ParameterError("pixel", [message.x, message.y], f"x below {width} and y below {height}")
        pixel = await self._work.run_short(viewport.picture.inspect, message.x, message.y)
        bands = pixel["bands"]
        await self._socket.send(
            InspectAnswer(
                view=viewport.name,
                x=message.x,
                y=message.y,
                material=pixel["material"],
                position=_triple(pixel["position"]),
                normal=_triple(pixel["normal"]),
                radiance=_triple(pixel["radiance"]),
                curve=pixel["curve"],
                bands=None if bands is None else rounded(bands),
            )
        )

    async def _render_highlight(self, viewport: Viewport, message: HighlightMessage, frame: int) -> bytes | None:
        progress = viewport.progress
        if viewport.target is None or progress is None:
            return None
        find_curve(message.curve, viewport.target.document)
        start_s = time.perf_counter()
        payload = await self._work.run_short(
            encode_highlight, viewport.picture, message.curve, message.from_degrees, message.to_degrees
        )
        width, height = viewport.size
        header = FrameHeader(
            frame=frame,
            revision=viewport.target.revision,
            room_revision=viewport.target.room_revision,
            view=viewport.name,
            width=width,
            height=height,
            tiles=[(0, 0, width, height)],
            format="r8",
            exact=viewport.is_exact,
            fidelity=progress.fidelity,
            complete=progress.complete,
            kind="highlight",
            ms=times(0.0, 0.0, (time.perf_counter() - start_s) * 1e3),
        )
        return pack(header, payload)


def _triple(values: Any) -> Any:
    """Three numbers for a message, or None."""
    return None if values is None else tuple(float(value) for value in values)
