"""Frozen operators and images, shared by all sessions that agree on everything dormant; held under a byte budget."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Collection, Hashable
from typing import Protocol, TypeVar
from weakref import WeakValueDictionary

from relume.errors import MemoryBudgetError


class Sized(Protocol):
    """What a cache may hold."""

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        ...


Entry = TypeVar("Entry", bound=Sized)


class FrozenCache:
    """Least recently used out first. Safe to use from several threads; two never freeze the same thing at once."""

    def __init__(self, budget_bytes: int) -> None:
        self.budget_bytes = budget_bytes
        self._entries: OrderedDict[Hashable, Sized] = OrderedDict()
        # a lock lives as long as somebody makes or waits: all who want a key share one
        self._making: WeakValueDictionary[Hashable, threading.Lock] = WeakValueDictionary()
        self._lock = threading.Lock()
        self._used = 0

    @property
    def used_bytes(self) -> int:
        """What the entries hold now."""
        return self._used

    def find(self, key: Hashable, kind: type[Entry]) -> Entry | None:
        """The entry, now the most recently used, or None where there is none of that kind."""
        with self._lock:
            if key in self._entries:
                self._entries.move_to_end(key)
            found = self._entries.get(key)
            return found if isinstance(found, kind) else None

    def check(self, num_bytes: int) -> None:
        """Raises MemoryBudgetError where an entry of so many bytes is larger than the budget."""
        if num_bytes > self.budget_bytes:
            raise MemoryBudgetError(
                "freezing this curve", num_bytes, self.budget_bytes, "bake a smaller picture or raise the cache budget"
            )

    def get(self, key: Hashable, kind: type[Entry], num_bytes: int, make: Callable[[], Entry]) -> Entry:
        """The entry; made by `make` where there is none, room for its `num_bytes` being made first.

        Raises:
            MemoryBudgetError: it alone is larger than the budget.
        """
        self.check(num_bytes)
        with self._lock:
            making = self._making.setdefault(key, threading.Lock())
        with making:
            found = self.find(key, kind)
            return found if found is not None else self._insert(key, num_bytes, make)

    def _insert(self, key: Hashable, num_bytes: int, make: Callable[[], Entry]) -> Entry:
        with self._lock:
            self._make_room(num_bytes)
            self._used += num_bytes  # reserved, so that two freezes at once stay under the budget together
        try:
            made = make()
        except BaseException:
            with self._lock:
                self._used -= num_bytes
            raise
        with self._lock:
            self._entries[key] = made
            self._used += made.num_bytes - num_bytes
        return made

    def shrink(self, floor_bytes: int, bakes: Collection[str]) -> None:
        """Drop entries of all but some bakes, least recently used first, until those left hold at most a floor.

        Args:
            bakes: whose entries stay; the first part of a key names its bake.
        """
        with self._lock:
            others = [key for key in self._entries if not (isinstance(key, tuple) and key[0] in bakes)]
            held = sum(self._entries[key].num_bytes for key in others)
            for key in others:
                if held <= floor_bytes:
                    return
                dropped = self._entries.pop(key).num_bytes
                held -= dropped
                self._used -= dropped

    def _make_room(self, num_bytes: int) -> None:
        while self._entries and self._used + num_bytes > self.budget_bytes:
            _, oldest = self._entries.popitem(last=False)
            self._used -= oldest.num_bytes
