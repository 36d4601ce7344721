"""The sending half of a session: one task that turns the newest wish into the next frame.

A turn does one thing: switch the view, note a touched curve, adopt what was frozen, paint, or answer. Work runs in
threads, one hop a frame; a picture is never used by two at once because only this task uses it. A freeze works on what
does not change, so it runs beside the turns.
"""

from __future__ import annotations

import asyncio
import time

from relume.errors import RelumeError
from server.live import painter
from server.live.answers import Answers
from server.live.edits import LookDesk
from server.live.freezing import Freezer
from server.live.painter import Order, Painted, Target
from server.live.ports import Library, Need, Transfer
from server.live.threads import OneAtATime, Threads
from server.live.viewport import Viewport
from server.live.window import Window
from server.live.wire import Wire
from server.live.wishes import Wishes
from server.metrics import Metrics

REST_S = 0.040  # a hand that moves edits at least this often; refining in between would only delay the next frame
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
        self._freezer = Freezer(wire, threads, metrics, wishes.news)
        self._answers = Answers(wire, self._work)
        self._accepted: Target | None = None
        self.view = view
        self._viewport: Viewport
        self._rest_until_s = 0.0

    async def run(self) -> None:
        """Serve until cancelled or until the client is lost."""
        try:
            await self._open_view(self.view)
            while True:
                self._wishes.news.clear()
                if not await self._turn():
                    await self._rest()
        finally:
            await self._freezer.end()
            await self._work.join()

    async def _turn(self) -> bool:
        """Do the most urgent thing; whether there was one."""
        wishes, viewport = self._wishes, self._viewport
        if (view := wishes.take_view()) is not None:
            await self._open_view(view)
            return True
        if (pointer := wishes.take_touch()) is not None:
            await self._touch(pointer)
            return True
        if self._freezer.is_done:
            await self._adopt()
            return True
        is_due = self._window.is_open and self._due_s(viewport) <= time.perf_counter()
        if is_due:
            await self._paint(viewport)
        is_asked = wishes.probe is not None or (wishes.brush is not None and self._window.is_open)
        if is_asked:
            frame = await self._answers.give(wishes, viewport, self._window)
            if frame is not None:
                await self._send_frame(frame, "brush", "r8")
        return is_due or is_asked

    def _due_s(self, viewport: Viewport) -> float:
        """When a view is to be painted: at once with a new look, refined when the hand rests."""
        if viewport.is_behind(self._wishes.target):
            return 0.0
        return float("inf") if viewport.is_settled else max(self._rest_until_s, viewport.not_before_s)

    async def _rest(self) -> None:
        """Wait for news, for the hand to have rested, or for the time to look after acknowledgements."""
        now_s = time.perf_counter()
        self._window.check(now_s)
        seconds = CHECK_S
        if self._window.is_open:
            seconds = min(seconds, max(0.0, self._due_s(self._viewport) - now_s))
        try:
            async with asyncio.timeout(seconds):
                await self._wishes.news.wait()
        except TimeoutError:
            return

    async def _open_view(self, name: str) -> None:
        """Show a view from the beginning; the look stays."""
        picture = await self._work.long(self._library.make_picture, self._transfer, name)
        self._viewport = Viewport(self._transfer.views[name], picture)
        self.view = name
        if self._accepted is not None:
            await self._work.quick(painter.accept, [picture], self._accepted)
        if self._answers.touched is not None:
            self._wishes.touch = self._wishes.touch or self._answers.touched
        self._freeze_next()

    async def _touch(self, pointer: str) -> None:
        """Prepare the curve that the user opened, in the newest look there is."""
        target = self._wishes.target
        self._answers.touched = pointer
        await self._answers.send_curve(target)
        if self._answers.touched is None:
            return
        try:
            if target is not self._accepted:
                await self._work.quick(painter.accept, [self._viewport.picture], target)
                self._accepted = target
        except RelumeError as error:
            await self._take_back(target, error)
        try:
            (self._viewport.need,) = await self._work.quick(painter.touch, [self._viewport.picture], pointer)
        except RelumeError as error:  # the look is another one now, or freezing it takes more memory than there is
            self._answers.touched = None
            await self._wire.refuse(error)
        self._freeze_next()

    async def _adopt(self) -> None:
        """Hand over what was made, where its view is still shown."""
        made = await self._freezer.take()
        if made is not None and made[0] is self._viewport:
            viewport, need, result = made
            viewport.adopted(await self._work.quick(painter.adopt, viewport.picture, need, result))
            self._rest_until_s = 0.0
        self._freeze_next()

    def _freeze_next(self) -> None:
        """Start what is needed most; what runs for nothing is ended."""
        running = self._freezer.running
        if running is None:
            if self._viewport.need is not None:
                self._freezer.start(self._viewport, self._viewport.need)
        elif self._is_stale(*running):
            self._freezer.cancel()

    def _is_stale(self, viewport: Viewport, need: Need) -> bool:
        """Whether the user has moved on; an image of an older look is still worth showing where there is none."""
        if viewport is not self._viewport:
            return True
        return need.state == "freezing" and (viewport.need is None or viewport.need.key != need.key)

    async def _paint(self, viewport: Viewport) -> None:
        """Paint the newest look, or go on with it; a look that the bake cannot follow is taken back."""
        target = self._wishes.target
        accepting = [viewport.picture] if target is not self._accepted else []
        order = viewport.order(target, self._wishes, self._window, accepting)
        try:
            painted = await self._work.quick(painter.paint, viewport.picture, order)
        except RelumeError as error:
            await self._take_back(target, error)
            return
        self._accepted = target
        if viewport.is_behind(target) and target.received_s is not None:
            self._rest_until_s = time.perf_counter() + REST_S
        viewport.painted(order, painted, self._wishes)
        if painted.message is not None:
            await self._deliver(viewport, order, painted, painted.message)
        await self._answers.send_curve(target)
        self._freeze_next()

    async def _deliver(self, viewport: Viewport, order: Order, painted: Painted, message: bytes) -> None:
        await self._send_frame(message, "picture", order.form)
        now_s = time.perf_counter()
        viewport.sent(now_s)
        self._metrics.update.observe(painted.update_ms / 1e3)
        self._metrics.encode.observe(painted.encode_ms / 1e3)
        if order.received_s is not None:
            self._metrics.edit_to_socket.observe(now_s - order.received_s)

    async def _send_frame(self, frame: bytes, kind: str, form: str) -> None:
        self._window.sent(len(frame), time.perf_counter())
        await self._wire.send_frame(frame)
        self._metrics.frames.labels(kind, form).inc()
        self._metrics.frame_bytes.inc(len(frame))

    async def _take_back(self, target: Target, error: RelumeError) -> None:
        """Go back to the look before; where there is none, or that one itself fails, the session cannot go on."""
        before = self._accepted
        if before is None or before is target:
            raise error
        await self._wire.refuse(error, target.revision)
        if self._wishes.target is target:  # a newer one stands on this and is refused itself
            self._wishes.target = before
            self._desk.revert(before)
        await self._work.quick(painter.accept, [self._viewport.picture], before)
