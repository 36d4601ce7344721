"""What was found of a store, or of anything large, stays while questions about the same follow each other."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Source = TypeVar("Source")
Value = TypeVar("Value")


class ReadCache(Generic[Source, Value]):
    """A function that remembers its last answer; for several threads, and travelling without what it keeps.

    Args:
        read: finds it; of a store, whose arrays for it are complete.
    """

    def __init__(self, read: Callable[[Source], Value]) -> None:
        self._read, self._lock = read, threading.Lock()
        self._last: tuple[Source, Value] | None = None

    def __reduce__(self) -> tuple[type[ReadCache[Source, Value]], tuple[Callable[[Source], Value]]]:
        return type(self), (self._read,)

    def __call__(self, source: Source) -> Value:
        """Of this very object."""
        with self._lock:
            if self._last is None or self._last[0] is not source:
                self._last = source, self._read(source)
            return self._last[1]
