"""Frozen operators, shared by all sessions that agree on everything dormant; held under a byte budget."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable

from relume.errors import MemoryBudgetError
from relume.transfer.frozen import Frozen


class FrozenCache:
    """Least recently used out first. Safe to use from several threads; two never freeze the same thing at once."""

    def __init__(self, budget_bytes: int) -> None:
        self.budget_bytes = budget_bytes
        self._entries: OrderedDict[Hashable, Frozen] = OrderedDict()
        self._making: dict[Hashable, threading.Lock] = {}
        self._lock = threading.Lock()
        self._used = 0

    @property
    def used_bytes(self) -> int:
        """What the entries hold now."""
        return self._used

    def find(self, key: Hashable) -> Frozen | None:
        """The entry, now the most recently used, or None."""
        with self._lock:
            if key in self._entries:
                self._entries.move_to_end(key)
            return self._entries.get(key)

    def get(self, key: Hashable, num_bytes: int, make: Callable[[], Frozen]) -> Frozen:
        """The entry; made by `make` where there is none, room for its `num_bytes` being made first.

        Raises:
            MemoryBudgetError: it alone is larger than the budget.
        """
        if num_bytes > self.budget_bytes:
            raise MemoryBudgetError(
                "freezing this curve", num_bytes, self.budget_bytes, "bake a smaller picture or raise the cache budget"
            )
        with self._lock:
            making = self._making.setdefault(key, threading.Lock())
        try:
            with making:
                found = self.find(key)
                return found if found is not None else self._insert(key, num_bytes, make)
        finally:
            with self._lock:
                self._making.pop(key, None)

    def _insert(self, key: Hashable, num_bytes: int, make: Callable[[], Frozen]) -> Frozen:
        with self._lock:
            self._make_room(num_bytes)
            self._used += num_bytes  # reserved, so that two freezes at once stay under the budget together
        try:
            frozen = make()
        except BaseException:
            with self._lock:
                self._used -= num_bytes
            raise
        with self._lock:
            self._entries[key] = frozen
            self._used += frozen.num_bytes - num_bytes
        return frozen

    def _make_room(self, num_bytes: int) -> None:
        while self._entries and self._used + num_bytes > self.budget_bytes:
            _, oldest = self._entries.popitem(last=False)
            self._used -= oldest.num_bytes
