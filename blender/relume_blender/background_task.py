"""A coroutine in a thread of its own, so that Blender goes on drawing; it can be canceled."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine
from typing import Any, Generic, TypeVar

Result = TypeVar("Result")


class BackgroundTask(Generic[Result]):
    """A running coroutine. `text` and `progress` are its last report.

    Args:
        work: gets a function that reports a text and progress from 0 to 1, and returns the coroutine.
    """

    def __init__(self, work: Callable[[Callable[[str, float], None]], Coroutine[Any, Any, Result]]) -> None:
        self.text, self.progress = "", 0.0
        self._work = work
        self._loop = asyncio.new_event_loop()
        self._task: asyncio.Task[Result] = self._loop.create_task(work(self._report))
        self._thread = threading.Thread(target=self._run, name="relume", daemon=True)
        self._thread.start()

    @property
    def is_done(self) -> bool:
        """True if it has ended in any way."""
        return not self._thread.is_alive()

    def cancel(self) -> None:
        """Ask it to end; it cleans up first."""
        self.text = "Canceling"
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._task.cancel)

    def result(self) -> Result:
        """Wait for its result. Raises what the coroutine raises; asyncio.CancelledError if it was canceled."""
        self._thread.join()
        return self._task.result()

    def _report(self, text: str, progress: float) -> None:
        self.text, self.progress = text, progress

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(asyncio.wait([self._task]))
            self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        finally:
            self._loop.close()
