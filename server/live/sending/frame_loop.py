"""The sending half of a session: one task that turns the newest wish into the next frame.

A turn does one thing: open a view, note a touched curve, install what was made, paint, or answer. Of several views the
one under the pointer goes first. Work runs in threads, one hop a frame; a picture is never used by two at once because
only this task uses it. A freeze works on what does not change, so it runs beside the turns.
"""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING

from relume.errors import NotMadeError, RelumeError
from relume.picture.transfer import Eyes
from server.library.ports import Library, Picture
from server.library.threads import OneAtATime, Threads
from server.live.sending import painter
from server.live.sending.answers import Answers
from server.live.sending.freezing import Freezer
from server.live.sending.painter import FrameRequest, Painted
from server.live.sending.tracing import told_of
from server.live.sending.viewport import Viewport
from server.live.session_state import SessionState
from server.live.state.target import Target

if TYPE_CHECKING:
    from relume.picture.jobs import Job
    from server.live.rooms.guest import Guest

REST_S = 0.040  # a hand that moves edits at least this often; refining in between would only delay the next frame
SETTLE_S = 0.250  # what only refines a picture takes both cores from the next edit
CHECK_S = 1.0


class FrameLoop:
    """The shown pictures on their way to one client."""

    def __init__(self, state: SessionState, library: Library, threads: Threads) -> None:
        self._socket, self._pending, self._shown, self._window = state.socket, state.pending, state.shown, state.window
        self._look, self._transfer = state.look, state.transfer
        self._metrics, self._traces = state.metrics, state.traces
        self._guest, self._may_edit = state.guest, state.caller.may_edit
        self._library, self._work = library, OneAtATime(threads)
        self._freezer = Freezer(state.socket, threads, state.metrics, state.traces, state.pending.news)
        self._answers = Answers(state.socket, self._work)
        self._delivery: asyncio.Task[None] | None = None
        self._accepted: Target | None = None
        self._viewports: dict[str, Viewport] = {}
        self._rest_until_s = self._settle_at_s = 0.0

    async def run(self) -> None:
        """Serve until cancelled or until the client is lost."""
        try:
            while True:
                self._pending.news.clear()
                if not await self._turn():
                    await self._rest()
        finally:
            if self._delivery is not None:
                self._delivery.cancel()
                await asyncio.wait({self._delivery})
            await self._freezer.end()
            await self._work.join()

    async def _turn(self) -> bool:
        """Do the most urgent thing; whether there was one."""
        if self._delivery is not None and self._delivery.done():
            self._delivery.result()
        self._follow_shown()
        if self._shown.focus not in self._viewports:
            await self._open_view(self._shown.focus)
        elif (pointer := self._pending.take_touch()) is not None:
            await self._touch(pointer)
        elif (parameter := self._pending.take_hold()) is not None:
            await self._prepare(parameter)
        elif self._freezer.is_done:
            await self._install()
        else:
            return await self._serve_views()
        return True

    async def _serve_views(self) -> bool:
        """Paint the view that is due, answer questions, open a view that is still missing; whether there was any."""
        viewport = self._most_urgent()
        if viewport is not None:
            await self._paint(viewport)
        has_answered = await self._answer()
        missing = [name for name in self._shown.names if name not in self._viewports]
        if viewport is None and not has_answered and missing:
            await self._open_view(missing[0])
            return True
        return viewport is not None or has_answered

    def _follow_shown(self) -> None:
        """Forget views that are not shown any more; those that were asked for again are sent whole."""
        again, self._shown.again = self._shown.again, set()
        self._viewports = {name: v for name, v in self._viewports.items() if name in self._shown.names}
        for name in again.intersection(self._viewports):
            self._viewports[name].show_again()
        self._freeze_next()

    def _by_urgency(self) -> list[Viewport]:
        """The view under the pointer, then the others, longest waiting first."""
        focus = self._shown.focus
        return sorted(self._viewports.values(), key=lambda viewport: (viewport.name != focus, viewport.served_s))

    def _most_urgent(self) -> Viewport | None:
        now_s = time.perf_counter()
        return next((v for v in self._by_urgency() if self._has_room(v) and self._due_s(v) <= now_s), None)

    def _has_room(self, viewport: Viewport) -> bool:
        return self._window.has_room(viewport.name, self._shown)

    def _due_s(self, viewport: Viewport) -> float:
        """When a view is to be painted: at once with a new look, refined when the hand rests."""
        pending = self._pending
        is_asked = viewport.has_to_move(pending) or viewport.has_other_evaluator(pending)
        if viewport.is_behind(pending.target) or is_asked or viewport.has_other_region(pending):
            return 0.0
        return float("inf") if viewport.is_settled else max(self._rest_until_s, viewport.not_before_s)

    async def _rest(self) -> None:
        """Wait for news, for the hand to have rested, or for the time to look after acknowledgements."""
        now_s = time.perf_counter()
        self._window.check(now_s)
        due_s = min((self._due_s(v) for v in self._viewports.values() if self._has_room(v)), default=float("inf"))
        if self._freezer.running is None and any(v.job is not None for v in self._viewports.values()):
            due_s = min(due_s, self._settle_at_s)
        try:
            async with asyncio.timeout(min(CHECK_S, max(0.0, due_s - now_s))):
                await self._pending.news.wait()
        except TimeoutError:
            return

    async def _open_view(self, name: str) -> None:
        """Show a view from the beginning; the look stays. One of several that cannot be shown is left out."""
        picture = await self._work.long(self._library.make_picture, self._transfer, name)
        try:
            if self._accepted is not None:
                await self._work.quick(painter.accept, [picture], self._accepted)
        except RelumeError as error:
            if not self._viewports:
                raise
            await self._socket.refuse(error)
            self._shown.hide(name)
            return
        if self._answers.touched is not None and self._may_edit:
            try:
                await self._work.quick(painter.touch, [picture], self._answers.touched)
            except RelumeError as error:  # the view is shown all the same
                await self._socket.refuse(error)
        self._viewports[name] = Viewport(self._transfer.views[name], picture, moves=self._transfer.eyes is Eyes.FREE)

    def _newest(self) -> Target:
        """The look that the pictures are given next."""
        if self._guest is not None:
            self._guest.painting(self._pending.target)
        return self._pending.target

    def _accept(self, target: Target) -> None:
        """The pictures can show this look, as `_newest` gave it."""
        self._accepted = target
        if self._guest is not None:
            self._guest.painted()

    def _pictures(self) -> list[Picture]:
        return [viewport.picture for viewport in self._viewports.values()]

    async def _touch(self, pointer: str) -> None:
        """Prepare the curve that the user opened, in the newest look; who may not edit is only told its values."""
        target = self._pending.target
        self._answers.touch(pointer)
        await self._answers.send_curve(target)
        if self._answers.touched is not None and self._may_edit and not await self._prepare(pointer):
            self._answers.touched = None

    async def _prepare(self, pointer: str) -> bool:
        """Freeze along what the user has in hand, in the newest look there is; False where that was refused."""
        target = self._newest()
        if target is not self._accepted:
            try:
                await self._work.quick(painter.accept, self._pictures(), target)
                self._accept(target)
            except RelumeError as error:
                await self._take_back(target, error)
        try:
            jobs = await self._work.quick(painter.touch, self._pictures(), pointer)
        except RelumeError as error:  # the look is another one now, or freezing it takes more memory than there is
            await self._socket.refuse(error)
            return False
        for viewport, job in zip(self._viewports.values(), jobs, strict=True):
            viewport.job = job
        return True

    async def _install(self) -> None:
        """Hand over what was made, where its view is still shown."""
        made = await self._freezer.take()
        if made is None:
            return
        viewport, job, result = made
        if viewport in self._viewports.values():
            viewport.installed(await self._work.quick(painter.install, viewport.picture, job, result))
            self._rest_until_s = 0.0
        await self._freezer.say_ready(viewport, job)
        if isinstance(result, NotMadeError):
            await self._socket.refuse(result)

    def _freeze_next(self) -> None:
        """Start what is needed most; what runs for nothing is ended."""
        running = self._freezer.running
        if running is not None:
            if self._is_stale(*running):
                self._freezer.cancel()
            return
        newest = self._pending.target
        is_still = not any(viewport.is_behind(newest) for viewport in self._viewports.values())
        is_resting = is_still and time.perf_counter() >= self._settle_at_s
        for viewport in self._by_urgency():
            if viewport.job is not None and (is_resting or not viewport.job.refines):
                self._freezer.start(viewport, viewport.job)
                return

    def _make_way(self, viewport: Viewport) -> None:
        """Something else of a view is seen: what is made of the rest of it goes on later from where it was."""
        running = self._freezer.running
        if running is None or running[0] is not viewport or not running[1].goes_on:
            return
        if viewport.job is not None and viewport.job.key != running[1].key:
            self._freezer.cancel()

    def _is_stale(self, viewport: Viewport, job: Job) -> bool:
        """Whether the user has moved on; an image of an older look is still worth showing where there is none."""
        if viewport not in self._viewports.values():
            return True
        is_dispensable = job.state == "freezing" or job.refines
        return is_dispensable and (viewport.job is None or viewport.job.key != job.key)

    async def _answer(self) -> bool:
        """The newest probe, and a brush's frame of one view; whether anything was asked."""
        pending, has_answered = self._pending, False
        asked = pending.probe.view or self._shown.focus if pending.probe is not None else None
        if asked in self._viewports and (probe := pending.take_probe()) is not None:
            await self._answers.answer_probe(self._viewports[asked], probe)
            has_answered = True
        if (brush := pending.take_brush()) is not None:
            for viewport in self._viewports.values():
                viewport.brush = brush
        for viewport in self._by_urgency():
            if viewport.brush is not None and self._has_room(viewport):
                is_focused = viewport.name == self._shown.focus
                frame = await self._answers.answer_brush(viewport, self._window.next_frame, is_focused)
                if frame is not None:
                    await self._hand_over(viewport, frame, "brush", "r8")
                return True
        return has_answered

    async def _paint(self, viewport: Viewport) -> None:
        """Paint the newest look, or go on with it; a look that the bake cannot follow is taken back."""
        painted: Painted | RelumeError
        async with self._work.turn():
            target = self._newest()
            accepting = self._pictures() if target is not self._accepted else []
            request = viewport.request(target, self._pending, self._window, accepting)
            try:
                painted = await self._work.in_turn(painter.paint, viewport.picture, request)
            except RelumeError as error:
                painted = error
        if isinstance(painted, RelumeError):
            await self._take_back(target, painted)
            return
        self._accept(target)
        viewport.served_s = time.perf_counter()
        is_moved = viewport.is_behind(target) and target.received_s is not None
        if is_moved or request.eye is not None:
            self._rest_until_s = time.perf_counter() + REST_S
            self._settle_at_s = time.perf_counter() + SETTLE_S
        viewport.painted(request, painted, self._pending)
        if request.is_turned:
            self._make_way(viewport)
        if painted.message is not None:
            await self._hand_over(viewport, painted.message, "picture", request.form, told=(request, painted))
        await self._answers.send_curve(target)

    async def _hand_over(
        self, viewport: Viewport, frame: bytes, kind: str, form: str, told: tuple[FrameRequest, Painted] | None = None
    ) -> None:
        """Send a frame when the one before has gone out, while the next is painted; told: what is to be said of it."""
        if self._delivery is not None:
            await self._delivery
        now_s = time.perf_counter()
        self._window.sent(viewport.name, len(frame), now_s)
        if told is not None:
            viewport.sent(now_s)
        self._delivery = asyncio.create_task(self._deliver(frame, kind, form, told))
        self._delivery.add_done_callback(self._note_failed)

    async def _deliver(self, frame: bytes, kind: str, form: str, told: tuple[FrameRequest, Painted] | None) -> None:
        sending_s = time.perf_counter()
        await self._socket.send_frame(frame)
        now_s = time.perf_counter()
        self._metrics.frames.labels(kind, form).inc()
        self._metrics.frame_bytes.inc(len(frame))
        if told is None:
            return
        request, painted = told
        self._metrics.update.observe(painted.update_ms / 1e3)
        self._metrics.encode.observe(painted.encode_ms / 1e3)
        if request.received_s is not None:
            self._metrics.edit_to_socket.observe(now_s - request.received_s)
            if self._traces is not None:
                name, times, about = told_of(request, painted, len(frame), sending_s, now_s)
                self._traces.frame(name, times, about)

    def _note_failed(self, delivery: asyncio.Task[None]) -> None:
        """The client is gone: whoever waits for news learns it."""
        if not delivery.cancelled() and delivery.exception() is not None:
            self._pending.news.set()

    async def _take_back(self, target: Target, error: RelumeError) -> None:
        """Go back to the look before; where there is none, or that one itself fails, the session cannot go on."""
        before = self._accepted
        if before is None or before is target:
            raise error
        if self._guest is not None:
            await self._take_back_own(self._guest, target, before, error)
        else:
            await self._socket.refuse(error, target.revision)
            if self._pending.target is target:  # a newer one stands on this and is refused itself
                self._pending.target = before
                self._look.revert(before)
        await self._work.quick(painter.accept, self._pictures(), before)

    async def _take_back_own(self, guest: Guest, target: Target, before: Target, error: RelumeError) -> None:
        """In a room a session takes back its own newest edits alone, if the pictures can show the look without them.

        If they cannot, it is somebody else's edit that this bake cannot follow: it keeps the picture that there was,
        and tries again with the next edit.
        """
        if self._pending.target is not target:  # the newer one says whether it can be shown
            return
        without = guest.without_own(before)
        if without is not None:
            try:
                await self._work.quick(painter.accept, self._pictures(), without)
            except RelumeError:
                without = None
            if self._pending.target is not target:
                return
        self._pending.target = before if without is None else guest.taken_back(without)
        await self._socket.refuse(error, None if without is None else target.revision)
