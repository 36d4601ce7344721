"""A one-entry cache for values read from a store or any large object."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Source = TypeVar("Source")
Value = TypeVar("Value")


class ReadCache(Generic[Source, Value]):
    """A function that caches its last result; thread-safe, and pickled without the cached value.

    Args:
        read: computes the value, from a store whose arrays for it are complete.
    """

    def __init__(self, read: Callable[[Source], Value]) -> None:
        self._read, self._lock = read, threading.Lock()
        self._last: tuple[Source, Value] | None = None

    def __reduce__(self) -> tuple[type[ReadCache[Source, Value]], tuple[Callable[[Source], Value]]]:
        return type(self), (self._read,)

    def __call__(self, source: Source) -> Value:
        """Return the value of this object, compared by identity."""
        with self._lock:
            if self._last is None or self._last[0] is not source:
                self._last = source, self._read(source)
            return self._last[1]
