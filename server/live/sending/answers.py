"""What the client asks besides frames: the open curve, a pixel, the pixels of a stretch of a curve."""

from __future__ import annotations

import time
from typing import Any

from relume.brdf.curves import curve_bands, generated_bands
from relume.errors import ParameterError, RelumeError
from server.library.threads import OneAtATime
from server.live.sending.painter import encode_brush, pack, rounded, times
from server.live.sending.viewport import Viewport
from server.live.state.client_socket import ClientSocket
from server.live.state.pointers import find_curve
from server.live.state.target import Target
from server.wire.protocol import BrushMessage, CurveMessage, FrameHeader, ProbeAnswer, ProbeMessage


class Answers:
    """Gives them from the frame loop, between frames.

    Attributes:
        touched: pointer of the curve that the user has opened.
    """

    def __init__(self, socket: ClientSocket, work: OneAtATime) -> None:
        self._socket, self._work = socket, work
        self.touched: str | None = None
        self._curve_sent_for: dict[str, Any] | None = None

    def touch(self, pointer: str) -> None:
        """Take note of the curve that the user has opened. It is sent anew: who closes a curve forgets it."""
        self.touched, self._curve_sent_for = pointer, None

    async def send_curve(self, target: Target) -> None:
        """The touched curve in this look, where its term has changed since it was last sent."""
        if self.touched is None:
            return
        try:
            term, curve = find_curve(self.touched, target.document)
        except ParameterError:  # an edit removed it
            self.touched = None
            return
        key = {"pointer": self.touched, "term": term}
        if key == self._curve_sent_for:
            return
        displayed, generated = await self._work.quick(
            lambda: (rounded(curve_bands(term, curve)), rounded(generated_bands(term, curve)))
        )
        await self._socket.send(
            CurveMessage(curve=self.touched, revision=target.revision, bands=displayed, generated=generated)
        )
        self._curve_sent_for = key

    async def answer_probe(self, viewport: Viewport, probe: ProbeMessage) -> None:
        """What makes up a pixel."""
        try:
            await self._probe(viewport, probe)
        except RelumeError as error:
            await self._socket.refuse(error)

    async def answer_brush(self, viewport: Viewport, frame: int, is_focused: bool) -> bytes | None:
        """The frame for a view's brush; only the focused one says why there is none."""
        brush, viewport.brush = viewport.brush, None
        try:
            return None if brush is None else await self._brush(viewport, brush, frame)
        except RelumeError as error:
            if is_focused:
                await self._socket.refuse(error)
            return None

    async def _probe(self, viewport: Viewport, probe: ProbeMessage) -> None:
        width, height = viewport.size
        if probe.x >= width or probe.y >= height:
            raise ParameterError("pixel", [probe.x, probe.y], f"x below {width} and y below {height}")
        found = await self._work.quick(viewport.picture.probe, probe.x, probe.y)
        bands = found["bands"]
        await self._socket.send(
            ProbeAnswer(
                view=viewport.name,
                x=probe.x,
                y=probe.y,
                material=found["material"],
                position=_triple(found["position"]),
                normal=_triple(found["normal"]),
                radiance=_triple(found["radiance"]),
                curve=found["curve"],
                bands=None if bands is None else rounded(bands),
            )
        )

    async def _brush(self, viewport: Viewport, brush: BrushMessage, frame: int) -> bytes | None:
        shown = viewport.advance
        if viewport.target is None or shown is None:
            return None
        find_curve(brush.curve, viewport.target.document)
        start_s = time.perf_counter()
        payload = await self._work.quick(
            encode_brush, viewport.picture, brush.curve, brush.from_degrees, brush.to_degrees
        )
        width, height = viewport.size
        header = FrameHeader(
            frame=frame,
            revision=viewport.target.revision,
            shared=viewport.target.shared,
            view=viewport.name,
            width=width,
            height=height,
            tiles=[(0, 0, width, height)],
            format="r8",
            exact=viewport.is_exact,
            fidelity=shown.fidelity,
            complete=shown.complete,
            kind="brush",
            ms=times(0.0, 0.0, (time.perf_counter() - start_s) * 1e3),
        )
        return pack(header, payload)


def _triple(values: Any) -> Any:
    """Three numbers for a message, where there are any."""
    return None if values is None else tuple(float(value) for value in values)
