"""Opened bakes, shared by all sessions and renders: each store is opened once and kept while somebody uses it."""

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
    """Opens by bake id; a few that nobody uses stay open for a while, most recently used first.

    Used from the event loop only.
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
            idle_s: how long a bake that nobody uses is kept. clock: seconds.
        """
        self._open_transfer, self._executor = open_transfer, executor
        self._idle_s, self._clock = idle_s, clock
        self._entries: OrderedDict[str, _Entry] = OrderedDict()
        self._last_used_s: dict[Path, float] = {}  # when somebody left it last

    @asynccontextmanager
    async def acquire(self, bake: str, path: Path) -> AsyncIterator[OpenBake]:
        """The transfer of a bake for as long as the block runs. Raises what opening raises (StoreError)."""
        entry = self._entries.get(bake)
        if entry is None:
            opening = asyncio.get_running_loop().run_in_executor(self._executor, self._open_transfer, path)
            entry = self._entries[bake] = _Entry(path, opening)
        entry.num_users += 1
        try:
            yield await asyncio.shield(entry.future)
        except BaseException:
            if entry.future.done() and (entry.future.cancelled() or entry.future.exception() is not None):
                self._discard(bake, entry)  # the next one tries again
            raise
        finally:
            entry.num_users -= 1
            self._last_used_s[path] = self._clock()
            self._trim(bake, entry)

    @property
    def open_bakes(self) -> list[OpenBake]:
        """Those that are open now; may be asked from any thread."""
        futures = [entry.future for entry in list(self._entries.values()) if entry.future.done()]
        return [future.result() for future in futures if not future.cancelled() and future.exception() is None]

    def is_used(self, bake: str) -> bool:
        """Whether somebody uses a bake now; may be asked from any thread."""
        entry = self._entries.get(bake)
        return entry is not None and entry.num_users > 0

    def release(self) -> tuple[int, Collection[Path]]:
        """Close bakes that nobody has used for a while.

        Returns:
            How many were closed, and the stores that are in use or were until a while ago.
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
