"""The sending half of a session: one task that turns the newest wish into the next frame.

A turn does one thing: switch the view, prepare a touched curve, paint the newest look, answer a probe or a brush, or
refine. Work runs in threads, one hop a frame; the picture is never used by two at once because only this task uses it.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Sequence
from typing import Any

from relume.brdf.curves import curve_bands, generated_bands
from relume.errors import CancelledError, MemoryBudgetError, ParameterError, RelumeError
from server.live.edits import LookDesk
from server.live.pace import Pace
from server.live.painter import Format, Order, Painted, Target, encode_brush, pack, paint, rounded, times
from server.live.pointers import find_curve
from server.live.ports import Library, Picture, Tile, Transfer
from server.live.threads import OneAtATime, Threads
from server.live.window import Window
from server.live.wire import Wire
from server.live.wishes import Wishes
from server.metrics import Metrics
from server.protocol import CurveMessage, FrameHeader, ProbeAnswer, StatusMessage

REST_S = 0.040  # a hand that moves edits at least this often; refining in between would only delay the next frame
REFINE_SEND_S = 0.100
STATUS_S = 0.100
CHECK_S = 1.0


class FrameLoop:
    """One picture on its way to one client."""

    def __init__(
        self,
        *,
        wire: Wire,
        wishes: Wishes,
        window: Window,
        desk: LookDesk,
        library: Library,
        transfer: Transfer,
        threads: Threads,
        metrics: Metrics,
        view: str,
    ) -> None:
        self._wire, self._wishes, self._window, self._desk = wire, wishes, window, desk
        self._library, self._transfer, self._metrics = library, transfer, metrics
        self._work = OneAtATime(threads)
        self._pace = Pace()
        self._shown = desk.target()
        self._view = view
        self._picture: Picture
        self._all_tiles: frozenset[Tile] = frozenset()
        self._lacking: frozenset[Tile] = frozenset()
        self._moving_bytes = 0
        self._is_settled = False
        self._rest_until_s = 0.0
        self._sent_s = 0.0
        self._touched: str | None = None
        self._curve_sent_for: dict[str, Any] | None = None
        self._cancel = threading.Event()
        self._freezing_for: frozenset[str] = frozenset()
        self._is_refining = False
        self._is_opening, self._num_frozen = True, 0

    @property
    def view(self) -> str:
        """Name of the view that is shown."""
        return self._view

    def moved_on_to(self, curves: frozenset[str]) -> None:
        """The user edits or opened these curves: a freeze for others is no longer wanted.

        Nor is one that only refines what the picture follows already: it begins again when the hand rests.
        """
        if self._is_refining or (curves and self._freezing_for and curves.isdisjoint(self._freezing_for)):
            self._cancel.set()

    def leave_view(self) -> None:
        """Another view is wanted: whatever is being frozen is for this one."""
        self._cancel.set()

    async def run(self) -> None:
        """Serve until cancelled or until the client is lost."""
        try:
            await self._open_view(self._view)
            while True:
                self._wishes.news.clear()
                if not await self._turn():
                    await self._rest()
        finally:
            self._cancel.set()
            await self._work.join()

    async def _turn(self) -> bool:
        """Do the most urgent thing; whether there was one."""
        wishes = self._wishes
        if (view := wishes.take_view()) is not None:
            await self._open_view(view)
            return True
        if (pointer := wishes.take_touch()) is not None:
            await self._touch(pointer)
            return True
        if wishes.target is not None and self._window.is_open:
            await self._show(wishes.take_target())
        elif self._may_refine():
            await self._show(None)
        elif wishes.probe is None and not (wishes.brush is not None and self._window.is_open):
            return False
        await self._answer()
        return True

    def _may_refine(self) -> bool:
        is_rested = time.perf_counter() >= self._rest_until_s
        return not self._is_settled and is_rested and self._window.is_open and self._wishes.target is None

    async def _rest(self) -> None:
        """Wait for news, for the hand to have rested, or for the time to look after acknowledgements."""
        now_s = time.perf_counter()
        self._window.check(now_s)
        seconds = CHECK_S
        if not self._is_settled and self._window.is_open:
            seconds = min(seconds, max(0.0, self._rest_until_s - now_s))
        try:
            async with asyncio.timeout(seconds):
                await self._wishes.news.wait()
        except TimeoutError:
            return

    async def _open_view(self, name: str) -> None:
        """Show another view from the beginning; the look stays."""
        self._picture = await self._work.long(self._library.make_picture, self._transfer, name)
        self._view = name
        self._is_opening, self._num_frozen = True, 0
        self._all_tiles = self._lacking = frozenset(self._picture.all_tiles())
        if self._wishes.target is None:
            self._wishes.target = self._desk.target()
        if self._touched is not None:
            self._wishes.touch = self._wishes.touch or self._touched

    async def _touch(self, pointer: str) -> None:
        """Prepare the curve that the user opened, in the newest look there is."""
        newest = self._wishes.target or self._shown
        self._touched = pointer
        await self._send_curve(newest)
        if self._touched is None:
            return
        try:
            await self._work.quick(self._picture.set_look, newest.look)
            await self._work.quick(self._picture.touch, pointer)
        except RelumeError as error:
            await self._wire.refuse(error)
        self._is_settled, self._rest_until_s = False, 0.0

    async def _show(self, target: Target | None) -> None:
        """Paint a new look, or go on with the one that is shown; a look that the bake cannot follow is taken back."""
        order = self._order(target)
        try:
            painted = await self._work.quick(paint, self._picture, order)
            if painted.waiting is None or order.partial:
                await self._deliver(order, painted)
            else:
                self._wishes.target = self._wishes.target or target
            await self._send_curve(order.shown)
            if painted.waiting is not None:
                await self._freeze(painted.waiting, is_refining=target is None and not self._is_opening)
        except RelumeError as error:
            await self._take_back(target, error)

    def _order(self, target: Target | None) -> Order:
        wishes, view = self._wishes, self._transfer.views[self._view]
        is_slow = self._window.is_slow_for(self._moving_bytes)
        form: Format = "rgb9e5"
        if wishes.form == "jpeg" or (wishes.form == "auto" and is_slow and target is not None):
            form = "jpeg"
        is_early = is_slow or time.perf_counter() - self._sent_s < REFINE_SEND_S
        return Order(
            target=target,
            shown=target or self._shown,
            max_coefficients=self._pace.max_coefficients,
            lacking=self._lacking,
            form=form,
            quality=wishes.quality,
            only_exact=target is None and is_early,
            partial=self._is_opening and self._num_frozen > 0,
            frame=self._window.next_frame,
            view=self._view,
            size=(view.width, view.height),
        )

    async def _deliver(self, order: Order, painted: Painted) -> None:
        """Send what was painted, and remember what the client has."""
        self._shown = order.shown
        self._pace.learn(painted.update_ms, painted.exact)
        if order.target is not None and order.target.received_s is not None:
            self._rest_until_s = time.perf_counter() + REST_S
            self._moving_bytes = 4 * sum(w * h for _, _, w, h in painted.tiles)
        if painted.message is None:
            self._lacking = self._lacking.union(painted.tiles)
            return
        self._lacking = self._all_tiles if order.form == "jpeg" else frozenset()
        self._is_opening = self._is_opening and not painted.exact
        self._is_settled = painted.exact and (order.form == "rgb9e5" or self._wishes.form == "jpeg")
        await self._send_frame(painted.message, "picture", order.form)
        self._metrics.update.observe(painted.update_ms / 1e3)
        self._metrics.encode.observe(painted.encode_ms / 1e3)
        if order.target is not None and order.target.received_s is not None:
            self._metrics.edit_to_socket.observe(self._sent_s - order.target.received_s)

    async def _send_frame(self, frame: bytes, kind: str, form: str) -> None:
        self._window.sent(len(frame), time.perf_counter())
        await self._wire.send_frame(frame)
        self._sent_s = time.perf_counter()
        self._metrics.frames.labels(kind, form).inc()
        self._metrics.frame_bytes.inc(len(frame))

    async def _take_back(self, target: Target | None, error: RelumeError) -> None:
        """Go back to the look that is shown; where that one itself fails, the session cannot go on."""
        if target is None and isinstance(error, MemoryBudgetError):  # a curve was opened that is too much to freeze
            self._touched = None
            await self._wire.refuse(error)
            await self._open_view(self._view)  # a new picture, that does not wait for this curve
            return
        if target is None or target.received_s is None:
            raise error
        if self._wishes.target is target:
            self._wishes.target = None
        await self._wire.refuse(error, target.revision)
        self._desk.revert(self._shown)
        await self._work.quick(self._picture.set_look, self._shown.look)

    async def _freeze(self, what: str, is_refining: bool) -> None:
        """Freeze in a thread and say how far it is; ends early when the user has moved on."""
        if self._wishes.view is not None or self._wishes.touch is not None:
            return  # moved on already
        self._cancel.clear()
        self._freezing_for, self._is_refining = self._wishes.focus, is_refining
        progress = [0.0]
        start_s = time.perf_counter()
        try:
            future = self._work.long(self._picture.freeze, lambda p: progress.__setitem__(0, p), self._cancel.is_set)
            await self._tell_until_done(future, what, progress)
        finally:
            self._freezing_for, self._is_refining = frozenset(), False
        await self._wire.send(StatusMessage(state="ready", what=what, progress=progress[0]))
        error = future.exception()
        if error is None:
            self._num_frozen += 1
            self._metrics.freeze.observe(time.perf_counter() - start_s)
        elif not isinstance(error, CancelledError):
            raise error

    async def _tell_until_done(self, future: asyncio.Future[None], what: str, progress: Sequence[float]) -> None:
        """Say how far it is, each per cent once."""
        told = -1.0
        while not future.done():
            shown = round(min(1.0, max(0.0, progress[0])), 2)
            if shown != told:
                told = shown
                await self._wire.send(StatusMessage(state="freezing", what=what, progress=shown))
            await asyncio.wait({future}, timeout=STATUS_S)

    async def _send_curve(self, target: Target) -> None:
        """The touched curve in this look, where its term has changed since it was last sent."""
        if self._touched is None:
            return
        try:
            term, curve = find_curve(self._touched, target.document)
        except ParameterError:  # an edit removed it
            self._touched = None
            return
        key = {"pointer": self._touched, "term": term}
        if key == self._curve_sent_for:
            return
        displayed, generated = await self._work.quick(
            lambda: (rounded(curve_bands(term, curve)), rounded(generated_bands(term, curve)))
        )
        await self._wire.send(
            CurveMessage(curve=self._touched, revision=target.revision, bands=displayed, generated=generated)
        )
        self._curve_sent_for = key

    async def _answer(self) -> None:
        """The newest probe and the newest brush."""
        wishes = self._wishes
        try:
            if (probe := wishes.take_probe()) is not None:
                await self._probe(probe.x, probe.y)
            if wishes.brush is not None and self._window.is_open and (brush := wishes.take_brush()) is not None:
                await self._brush(brush.curve, brush.from_degrees, brush.to_degrees)
        except RelumeError as error:
            await self._wire.refuse(error)

    async def _probe(self, x: int, y: int) -> None:
        view = self._transfer.views[self._view]
        if x >= view.width or y >= view.height:
            raise ParameterError("pixel", [x, y], f"x below {view.width} and y below {view.height}")
        found = await self._work.quick(self._picture.probe, x, y)
        bands = found["bands"]
        await self._wire.send(
            ProbeAnswer(
                view=self._view,
                x=x,
                y=y,
                material=found["material"],
                radiance=tuple(float(c) for c in found["radiance"]),
                curve=found["curve"],
                bands=None if bands is None else rounded(bands),
            )
        )

    async def _brush(self, pointer: str, from_degrees: float, to_degrees: float) -> None:
        find_curve(pointer, self._shown.document)
        start_s = time.perf_counter()
        payload = await self._work.quick(encode_brush, self._picture, pointer, from_degrees, to_degrees)
        view = self._transfer.views[self._view]
        header = FrameHeader(
            frame=self._window.next_frame,
            revision=self._shown.revision,
            view=self._view,
            width=view.width,
            height=view.height,
            tiles=[(0, 0, view.width, view.height)],
            format="r8",
            exact=self._is_settled,
            kind="brush",
            ms=times(0.0, 0.0, (time.perf_counter() - start_s) * 1e3),
        )
        await self._send_frame(pack(header, payload), "brush", "r8")
