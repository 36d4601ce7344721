"""Opened bakes, shared by all sessions and renders: each store is opened once and kept while somebody uses it."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Executor
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from server.live.ports import Transfer

MAX_IDLE = 2


@dataclass
class _Entry:
    future: asyncio.Future[Transfer]
    num_users: int = 0


class TransferPool:
    """Opens by bake id; a few that nobody uses stay open, most recently used first. Used from the event loop only."""

    def __init__(self, open_transfer: Callable[[Path], Transfer], executor: Executor) -> None:
        self._open_transfer, self._executor = open_transfer, executor
        self._entries: OrderedDict[str, _Entry] = OrderedDict()

    @asynccontextmanager
    async def using(self, bake: str, path: Path) -> AsyncIterator[Transfer]:
        """The transfer of a bake for as long as the block runs. Raises what opening raises (StoreError)."""
        entry = self._entries.get(bake)
        if entry is None:
            opening = asyncio.get_running_loop().run_in_executor(self._executor, self._open_transfer, path)
            entry = self._entries[bake] = _Entry(opening)
        entry.num_users += 1
        try:
            yield await asyncio.shield(entry.future)
        except BaseException:
            if entry.future.done() and (entry.future.cancelled() or entry.future.exception() is not None):
                self._forget(bake, entry)  # the next one tries again
            raise
        finally:
            entry.num_users -= 1
            self._trim(bake, entry)

    def _forget(self, bake: str, entry: _Entry) -> None:
        if self._entries.get(bake) is entry:
            del self._entries[bake]

    def _trim(self, bake: str, entry: _Entry) -> None:
        if self._entries.get(bake) is entry:
            self._entries.move_to_end(bake)
        idle = [name for name, e in self._entries.items() if e.num_users == 0]
        for name in idle[: max(0, len(idle) - MAX_IDLE)]:
            del self._entries[name]
