"""Sending half of a session: one task that turns the newest request into the next frame.

Each turn does one thing: open a view, prepare a curve, install a result, paint, or answer. Of several views the focused
one goes first. Work runs in threads, one hop per frame; an image is never used twice at once because only this task
uses it. Precomputing uses immutable data, so it runs in parallel.
"""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING

from relume.core.errors import RelumeError, ResultUnavailableError
from relume.live.fixed_camera.jobs import Job, Priority
from relume.live.fixed_camera.protocols import CameraMode
from relume_server.client_state.target import Target
from relume_server.runtime.executors import SerialExecutor, Threads
from relume_server.runtime.protocols import Library, Picture
from relume_server.session.frames import painter
from relume_server.session.frames.frame_spans import trace_fields
from relume_server.session.frames.painter import FrameRequest, Painted
from relume_server.session.frames.precompute import Precomputer
from relume_server.session.frames.responses import QueryResponder
from relume_server.session.frames.viewport import Viewport
from relume_server.session.session_state import SessionState

if TYPE_CHECKING:
    from relume_server.collaboration.member import RoomMember

REFINE_DELAY_S = 0.040  # a drag sends edits at least this often; refining in between would only delay the next frame
BACKGROUND_DELAY_S = 0.250  # refinement uses both cores, which the next edit needs
CHECK_INTERVAL_S = 1.0


class FrameLoop:
    """Sends the frames of the visible views to one client."""

    def __init__(self, state: SessionState, library: Library, threads: Threads) -> None:
        self._socket, self._pending, self._visible_views, self._window = (
            state.socket,
            state.pending,
            state.visible_views,
            state.window,
        )
        self._look, self._transfer = state.look, state.transfer
        self._metrics, self._traces = state.metrics, state.traces
        self._member, self._may_edit = state.member, state.caller.may_edit
        self._library, self._work = library, SerialExecutor(threads)
        self._precomputer = Precomputer(state.socket, threads, state.metrics, state.traces, state.pending.changed)
        self._answers = QueryResponder(state.socket, self._work)
        self._delivery: asyncio.Task[None] | None = None
        self._accepted: Target | None = None
        self._viewports: dict[str, Viewport] = {}
        self._refine_at_s = self._background_at_s = 0.0

    async def run(self) -> None:
        """Serve until canceled, or until the client is lost."""
        try:
            while True:
                self._pending.changed.clear()
                if not await self._step():
                    await self._wait()
        finally:
            if self._delivery is not None:
                self._delivery.cancel()
                await asyncio.wait({self._delivery})
            await self._precomputer.end()
            await self._work.join()

    async def _step(self) -> bool:
        """Do the most urgent task; true if there was one."""
        if self._delivery is not None and self._delivery.done():
            self._delivery.result()
        self._sync_viewports()
        if self._visible_views.focus not in self._viewports:
            await self._open_view(self._visible_views.focus)
        elif (pointer := self._pending.pop_prepare()) is not None:
            await self._prepare_curve(pointer)
        elif (parameter := self._pending.pop_active()) is not None:
            await self._prepare(parameter)
        elif self._precomputer.is_done:
            await self._install()
        else:
            return await self._serve_views()
        return True

    async def _serve_views(self) -> bool:
        """Paint the due view, answer queries, or open a missing view; true if there was anything to do."""
        viewport = self._next_due()
        if viewport is not None:
            await self._paint(viewport)
        has_answered = await self._answer()
        missing = [name for name in self._visible_views.names if name not in self._viewports]
        if viewport is None and not has_answered and missing:
            await self._open_view(missing[0])
            return True
        return viewport is not None or has_answered

    def _sync_viewports(self) -> None:
        """Drop views that are no longer visible; views that were requested again are resent."""
        resend_names, self._visible_views.resend_names = self._visible_views.resend_names, set()
        self._viewports = {
            name: viewport for name, viewport in self._viewports.items() if name in self._visible_views.names
        }
        for name in resend_names.intersection(self._viewports):
            self._viewports[name].resend()
        self._start_next_job()

    def _by_urgency(self) -> list[Viewport]:
        """The focused view, then the others, longest waiting first."""
        focus = self._visible_views.focus
        return sorted(self._viewports.values(), key=lambda viewport: (viewport.name != focus, viewport.served_s))

    def _next_due(self) -> Viewport | None:
        now_s = time.perf_counter()
        return next((v for v in self._by_urgency() if self._has_room(v) and self._due_s(v) <= now_s), None)

    def _has_room(self, viewport: Viewport) -> bool:
        return self._window.has_room(viewport.name, self._visible_views)

    def _due_s(self, viewport: Viewport) -> float:
        """Time at which a view is to be painted: at once for a new look, refined after a drag."""
        pending = self._pending
        is_asked = viewport.needs_camera_update(pending) or viewport.has_new_renderer(pending)
        if viewport.is_outdated(pending.target) or is_asked or viewport.has_new_region(pending):
            return 0.0
        return float("inf") if viewport.is_converged else max(self._refine_at_s, viewport.not_before_s)

    async def _wait(self) -> None:
        """Wait for requests, for the end of a drag, or for an acknowledgment timeout."""
        now_s = time.perf_counter()
        self._window.check(now_s)
        due_s = min((self._due_s(v) for v in self._viewports.values() if self._has_room(v)), default=float("inf"))
        if self._precomputer.running is None and any(v.job is not None for v in self._viewports.values()):
            due_s = min(due_s, self._background_at_s)
        try:
            async with asyncio.timeout(min(CHECK_INTERVAL_S, max(0.0, due_s - now_s))):
                await self._pending.changed.wait()
        except TimeoutError:
            return

    async def _open_view(self, name: str) -> None:
        """Show a view from the beginning; the look is unchanged. One of several that cannot be shown is dropped."""
        picture = await self._work.submit_long(self._library.make_picture, self._transfer, name)
        try:
            if self._accepted is not None:
                await self._work.run_short(painter.accept, [picture], self._accepted)
        except RelumeError as error:
            if not self._viewports:
                raise
            await self._socket.refuse(error)
            self._visible_views.hide(name)
            return
        if self._answers.open_curve is not None and self._may_edit:
            try:
                await self._work.run_short(painter.prepare, [picture], self._answers.open_curve)
            except RelumeError as error:  # the view is shown anyway
                await self._socket.refuse(error)
        self._viewports[name] = Viewport(
            self._transfer.views[name], picture, is_free_camera=self._transfer.camera_mode is CameraMode.FREE
        )

    def _next_target(self) -> Target:
        """Target that the images get next."""
        if self._member is not None:
            self._member.on_painting(self._pending.target)
        return self._pending.target

    def _accept(self, target: Target) -> None:
        """Record that the images can show the target of `_next_target`."""
        self._accepted = target
        if self._member is not None:
            self._member.on_painted()

    def _pictures(self) -> list[Picture]:
        return [viewport.picture for viewport in self._viewports.values()]

    async def _prepare_curve(self, pointer: str) -> None:
        """Prepare the curve that the user opened, in the newest look; view-only clients get its values only."""
        target = self._pending.target
        self._answers.set_open_curve(pointer)
        await self._answers.send_curve(target)
        if self._answers.open_curve is not None and self._may_edit and not await self._prepare(pointer):
            self._answers.open_curve = None

    async def _prepare(self, pointer: str) -> bool:
        """Precompute for the active control, in the newest look; false if that was refused."""
        target = self._next_target()
        if target is not self._accepted:
            try:
                await self._work.run_short(painter.accept, self._pictures(), target)
                self._accept(target)
            except RelumeError as error:
                await self._revert(target, error)
        try:
            jobs = await self._work.run_short(painter.prepare, self._pictures(), pointer)
        except RelumeError as error:  # the look has changed, or precomputing needs more memory than there is
            await self._socket.refuse(error)
            return False
        for viewport, job in zip(self._viewports.values(), jobs, strict=True):
            viewport.job = job
        return True

    async def _install(self) -> None:
        """Install a finished result, if its view is still visible."""
        finished = await self._precomputer.take()
        if finished is None:
            return
        viewport, job, result = finished
        if viewport in self._viewports.values():
            viewport.on_installed(await self._work.run_short(painter.apply, viewport.picture, job, result))
            self._refine_at_s = 0.0
        await self._precomputer.send_ready(viewport, job)
        if isinstance(result, ResultUnavailableError):
            await self._socket.refuse(result)

    def _start_next_job(self) -> None:
        """Start the most urgent job; cancel one that is no longer needed."""
        running = self._precomputer.running
        if running is not None:
            if self._is_stale(*running):
                self._precomputer.cancel()
            return
        newest = self._pending.target
        is_painted = not any(viewport.is_outdated(newest) for viewport in self._viewports.values())
        is_idle = is_painted and time.perf_counter() >= self._background_at_s
        for viewport in self._by_urgency():
            if viewport.job is not None and (is_idle or not viewport.job.is_refinement):
                self._precomputer.start(viewport, viewport.job)
                return

    def _preempt(self, viewport: Viewport) -> None:
        """Interrupt a view's job because its visible region changed; it resumes later."""
        running = self._precomputer.running
        if running is None or running[0] is not viewport or not running[1].is_resumable:
            return
        if viewport.job is not None and viewport.job.key != running[1].key:
            self._precomputer.cancel()

    def _is_stale(self, viewport: Viewport, job: Job) -> bool:
        """True if a job is no longer needed; an image of an older look is still useful if there is none."""
        if viewport not in self._viewports.values():
            return True
        is_optional = job.priority in (Priority.CONTROL, Priority.REFINEMENT)
        return is_optional and (viewport.job is None or viewport.job.key != job.key)

    async def _answer(self) -> bool:
        """Answer the newest pixel probe, or send a highlight of one view; true if there was one."""
        pending, has_answered = self._pending, False
        inspected_view = pending.inspect.view or self._visible_views.focus if pending.inspect is not None else None
        if inspected_view in self._viewports and (inspect_message := pending.pop_inspect()) is not None:
            await self._answers.answer_inspect(self._viewports[inspected_view], inspect_message)
            has_answered = True
        if (highlight_message := pending.pop_highlight()) is not None:
            for viewport in self._viewports.values():
                viewport.highlight = highlight_message
        for viewport in self._by_urgency():
            if viewport.highlight is not None and self._has_room(viewport):
                is_focused = viewport.name == self._visible_views.focus
                frame = await self._answers.answer_highlight(viewport, self._window.next_frame, is_focused)
                if frame is not None:
                    await self._send_frame(viewport, frame, "highlight", "r8")
                return True
        return has_answered

    async def _paint(self, viewport: Viewport) -> None:
        """Paint the newest look, or refine it; a look that the bake does not support is reverted."""
        painted: Painted | RelumeError
        async with self._work.acquire_slot():
            target = self._next_target()
            accepting = self._pictures() if target is not self._accepted else []
            request = viewport.request(target, self._pending, self._window, accepting)
            try:
                painted = await self._work.run_in_slot(painter.paint, viewport.picture, request)
            except RelumeError as error:
                painted = error
        if isinstance(painted, RelumeError):
            await self._revert(target, painted)
            return
        self._accept(target)
        viewport.served_s = time.perf_counter()
        is_moved = viewport.is_outdated(target) and target.received_s is not None
        if is_moved or request.camera_state is not None:
            self._refine_at_s = time.perf_counter() + REFINE_DELAY_S
            self._background_at_s = time.perf_counter() + BACKGROUND_DELAY_S
        viewport.on_painted(request, painted, self._pending)
        if request.has_new_region:
            self._preempt(viewport)
        if painted.message is not None:
            await self._send_frame(viewport, painted.message, "picture", request.form, outcome=(request, painted))
        await self._answers.send_curve(target)

    async def _send_frame(
        self,
        viewport: Viewport,
        frame: bytes,
        kind: str,
        form: str,
        outcome: tuple[FrameRequest, Painted] | None = None,
    ) -> None:
        """Send a frame after the previous one, while the next is painted; `outcome` is for metrics and traces."""
        if self._delivery is not None:
            await self._delivery
        now_s = time.perf_counter()
        self._window.on_sent(viewport.name, len(frame), now_s)
        if outcome is not None:
            viewport.on_sent(now_s)
        self._delivery = asyncio.create_task(self._deliver(frame, kind, form, outcome))
        self._delivery.add_done_callback(self._note_failed)

    async def _deliver(self, frame: bytes, kind: str, form: str, outcome: tuple[FrameRequest, Painted] | None) -> None:
        send_start_s = time.perf_counter()
        await self._socket.send_frame(frame)
        now_s = time.perf_counter()
        self._metrics.frames.labels(kind, form).inc()
        self._metrics.frame_bytes.inc(len(frame))
        if outcome is None:
            return
        request, painted = outcome
        self._metrics.update.observe(painted.update_ms / 1e3)
        self._metrics.encode.observe(painted.encode_ms / 1e3)
        if request.received_s is not None:
            self._metrics.edit_to_socket.observe(now_s - request.received_s)
            if self._traces is not None:
                name, times, attributes = trace_fields(request, painted, len(frame), send_start_s, now_s)
                self._traces.record_frame(name, times, attributes)

    def _note_failed(self, delivery: asyncio.Task[None]) -> None:
        """Wake up waiting tasks, because the client is gone."""
        if not delivery.cancelled() and delivery.exception() is not None:
            self._pending.changed.set()

    async def _revert(self, target: Target, error: RelumeError) -> None:
        """Revert to the previous look; if there is none, or it fails as well, the session ends."""
        before = self._accepted
        if before is None or before is target:
            raise error
        if self._member is not None:
            await self._revert_own(self._member, target, before, error)
        else:
            await self._socket.refuse(error, target.revision)
            if self._pending.target is target:  # a newer edit builds on it and is rejected itself
                self._pending.target = before
                self._look.revert(before)
        await self._work.run_short(painter.accept, self._pictures(), before)

    async def _revert_own(self, member: RoomMember, target: Target, before: Target, error: RelumeError) -> None:
        """In a room, revert only this session's own newest edits, if the images support the look without them.

        If they do not, the bake does not support another participant's edit: the image stays, and the next edit is
        tried.
        """
        if self._pending.target is not target:  # the newer look decides
            return
        without = member.without_own_edits(before)
        if without is not None:
            try:
                await self._work.run_short(painter.accept, self._pictures(), without)
            except RelumeError:
                without = None
            if self._pending.target is not target:
                return
        self._pending.target = before if without is None else member.reverted(without)
        await self._socket.refuse(error, None if without is None else target.revision)
