"""Open bakes, shared by all sessions and renders: each store is opened once, and stays open while it is in use."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable, Collection
from concurrent.futures import Executor
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from relume.live.fixed_camera.protocols import OpenBake

MAX_IDLE = 2


@dataclass
class _Entry:
    path: Path
    future: asyncio.Future[OpenBake]
    num_users: int = 0


class TransferPool:
    """Opens bakes by id; a few unused ones stay open for a while, most recently used first.

    Event loop only.
    """

    def __init__(
        self,
        open_transfer: Callable[[Path], OpenBake],
        executor: Executor,
        idle_s: float,
        clock: Callable[[], float],
    ) -> None:
        """
        Args:
            open_transfer: opens a store. executor: executor for opening.
            idle_s: time for which an unused bake stays open. clock: monotonic seconds.
        """
        self._open_transfer, self._executor = open_transfer, executor
        self._idle_s, self._clock = idle_s, clock
        self._entries: OrderedDict[str, _Entry] = OrderedDict()
        self._last_used_s: dict[Path, float] = {}  # when it was last released

    @asynccontextmanager
    async def acquire(self, bake: str, path: Path) -> AsyncIterator[OpenBake]:
        """Yield the transfer of a bake. Raises StoreError if it cannot be opened."""
        entry = self._entries.get(bake)
        if entry is None:
            opening = asyncio.get_running_loop().run_in_executor(self._executor, self._open_transfer, path)
            entry = self._entries[bake] = _Entry(path, opening)
        entry.num_users += 1
        try:
            yield await asyncio.shield(entry.future)
        except BaseException:
            if entry.future.done() and (entry.future.cancelled() or entry.future.exception() is not None):
                self._discard(bake, entry)  # the next caller retries
            raise
        finally:
            entry.num_users -= 1
            self._last_used_s[path] = self._clock()
            self._trim(bake, entry)

    @property
    def open_bakes(self) -> list[OpenBake]:
        """Bakes that are open now. Thread-safe."""
        futures = [entry.future for entry in list(self._entries.values()) if entry.future.done()]
        return [future.result() for future in futures if not future.cancelled() and future.exception() is None]

    def is_used(self, bake: str) -> bool:
        """True if a bake is in use now. Thread-safe."""
        entry = self._entries.get(bake)
        return entry is not None and entry.num_users > 0

    def release(self) -> tuple[int, Collection[Path]]:
        """Close bakes that have been unused for a while.

        Returns:
            Number of closed bakes, and stores that are, or recently were, in use.
        """
        long_ago = self._clock() - self._idle_s
        self._last_used_s = {path: used_s for path, used_s in self._last_used_s.items() if used_s > long_ago}
        idle = [
            name
            for name, entry in self._entries.items()
            if entry.num_users == 0 and entry.path not in self._last_used_s
        ]
        for name in idle:
            del self._entries[name]
        return len(idle), {entry.path for entry in self._entries.values()} | self._last_used_s.keys()

    def _discard(self, bake: str, entry: _Entry) -> None:
        if self._entries.get(bake) is entry:
            del self._entries[bake]

    def _trim(self, bake: str, entry: _Entry) -> None:
        if self._entries.get(bake) is entry:
            self._entries.move_to_end(bake)
        idle = [name for name, e in self._entries.items() if e.num_users == 0]
        for name in idle[: max(0, len(idle) - MAX_IDLE)]:
            del self._entries[name]
