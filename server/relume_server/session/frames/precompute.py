"""Precomputing of a session: at most one job in a thread of its own, while images are painted."""

from __future__ import annotations

import asyncio
import threading
import time
from dataclasses import dataclass
from typing import Any

from relume.core.errors import CancelledError
from relume.live.fixed_camera.jobs import Job, Priority
from relume_server.client_state.socket import ClientSocket
from relume_server.runtime.executors import Threads
from relume_server.schemas.protocol import StatusMessage
from relume_server.session.frames.viewport import Viewport
from relume_server.telemetry.metrics import Metrics
from relume_server.telemetry.traces import Traces

STATUS_INTERVAL_S = 0.100


@dataclass(frozen=True)
class _Running:
    """A job from its start until its result is taken."""

    viewport: Viewport
    job: Job
    future: asyncio.Future[Any]
    reporting: asyncio.Task[None]
    start_s: float


class Precomputer:
    """Runs a job, reports its progress, and returns its result; `changed` is set when a result can be taken."""

    def __init__(
        self, socket: ClientSocket, threads: Threads, metrics: Metrics, traces: Traces | None, changed: asyncio.Event
    ) -> None:
        self._socket, self._threads, self._metrics, self._traces, self._changed = (
            socket,
            threads,
            metrics,
            traces,
            changed,
        )
        self._running: _Running | None = None
        self._cancel = threading.Event()

    @property
    def running(self) -> tuple[Viewport, Job] | None:
        """Running job, and its view."""
        return None if self._running is None else (self._running.viewport, self._running.job)

    @property
    def is_done(self) -> bool:
        """True if there is a result to take."""
        return self._running is not None and self._running.reporting.done()

    def start(self, viewport: Viewport, job: Job) -> None:
        """Start a job; none may be running."""
        self._cancel = cancel = threading.Event()
        progress = [0.0]
        future = asyncio.wrap_future(
            self._threads.long.submit(job.run, lambda share: progress.__setitem__(0, share), cancel.is_set)
        )
        future.add_done_callback(_note_error)
        reporting = asyncio.create_task(self._send_progress(future, viewport.name, job, progress))
        reporting.add_done_callback(lambda _: self._changed.set())
        self._running = _Running(viewport, job, future, reporting, time.perf_counter())

    def cancel(self) -> None:
        """Cancel the running job, which ends soon."""
        self._cancel.set()

    async def take(self) -> tuple[Viewport, Job, Any] | None:
        """Take the result when `is_done`; None if the job was canceled. Raises the job's exception."""
        running = self._running
        if running is None:
            return None
        await running.reporting  # if the client is gone, `end` still waits for the thread
        self._running = None
        error = running.future.exception()
        if isinstance(error, CancelledError):
            await self.send_ready(running.viewport, running.job)
            return None
        if error is not None:
            raise error
        if _is_reported(running.job):
            self._metrics.freeze.observe(time.perf_counter() - running.start_s)
        if self._traces is not None:
            attributes = {"view": running.viewport.name, "label": running.job.label, "state": running.job.state}
            self._traces.record_freeze(running.start_s, attributes)
        return running.viewport, running.job, running.future.result()

    async def send_ready(self, viewport: Viewport, job: Job) -> None:
        """Notify the client that the job is installed or given up."""
        if _is_reported(job):
            await self._socket.send(StatusMessage(state="ready", view=viewport.name, label=job.label, progress=1.0))

    async def end(self) -> None:
        """Cancel the running job and wait for its thread; its result is dropped."""
        self._cancel.set()
        if self._running is None:
            return
        running, self._running = self._running, None
        running.reporting.cancel()
        await asyncio.wait({running.reporting, running.future})
        _note_error(running.reporting)

    async def _send_progress(self, future: asyncio.Future[Any], view: str, job: Job, progress: list[float]) -> None:
        """Report progress, each percent once; not for jobs of a drag."""
        if not _is_reported(job):
            await asyncio.wait({future})
            return
        last_fraction = -1.0
        while not future.done():
            fraction = round(min(1.0, max(0.0, progress[0])), 2)
            if fraction != last_fraction:
                last_fraction = fraction
                await self._socket.send(StatusMessage(state=job.state, view=view, label=job.label, progress=fraction))
            await asyncio.wait({future}, timeout=STATUS_INTERVAL_S)


def _is_reported(job: Job) -> bool:
    """True if its status is sent; updates of a drag take only a few frames."""
    return job.priority is not Priority.UPDATE


def _note_error(done: asyncio.Future[Any]) -> None:
    """Retrieve the exception of a dropped job, so that asyncio does not log it."""
    if not done.cancelled():
        done.exception()
