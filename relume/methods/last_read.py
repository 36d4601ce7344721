"""What was read of a store stays while tasks of that store follow each other."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from relume.bake import StoreReader

Value = TypeVar("Value")


class LastRead(Generic[Value]):
    """A function of stores that remembers its last answer; for several threads, and travelling without what it keeps.

    Args:
        read: finds it, of a store whose arrays for it are complete.
    """

    def __init__(self, read: Callable[[StoreReader], Value]) -> None:
        self._read, self._lock = read, threading.Lock()
        self._last: tuple[StoreReader, Value] | None = None

    def __reduce__(self) -> tuple[type[LastRead[Value]], tuple[Callable[[StoreReader], Value]]]:
        return type(self), (self._read,)

    def __call__(self, store: StoreReader) -> Value:
        """Of this store."""
        with self._lock:
            if self._last is None or self._last[0] is not store:
                self._last = store, self._read(store)
            return self._last[1]
