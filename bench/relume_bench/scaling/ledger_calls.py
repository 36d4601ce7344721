"""Counts the statements that this process sends to a ledger, and the calls that fail by a lock."""

from __future__ import annotations

import threading
from collections import Counter
from itertools import pairwise
from typing import Any

from sqlalchemy import Engine, event

_LOCK_WORDS = ("locked", "deadlock", "serializ", "lock timeout", "too many clients", "QueuePool limit")


class LedgerCalls:
    """Counts the statements of all engines of this process, from its creation on. Thread-safe."""

    def __init__(self) -> None:
        self._lock, self._statements, self._num_lock_errors = threading.Lock(), Counter[str](), 0
        event.listen(Engine, "before_cursor_execute", self._count)
        event.listen(Engine, "handle_error", self._count_error)

    def _count(self, connection: object, cursor: object, statement: str, *_: object) -> None:
        with self._lock:
            self._statements[_kind(statement)] += 1

    def _count_error(self, context: Any) -> None:
        text = str(context.original_exception)
        if any(word in text for word in _LOCK_WORDS):
            with self._lock:
                self._num_lock_errors += 1

    def read(self) -> dict[str, Any]:
        """Statements so far by verb and table, and failures by a lock."""
        with self._lock:
            return {"statements": dict(self._statements), "lock_errors": self._num_lock_errors}


def _kind(statement: str) -> str:
    """Verb and table of a statement, such as "SELECT bakes"."""
    words = statement.replace("\n", " ").split()
    verb = words[0].upper()
    before = {"SELECT": "FROM", "DELETE": "FROM", "INSERT": "INTO"}.get(verb, verb)
    tables = [after for word, after in pairwise(words) if word.upper() == before and "(" not in after]
    return f"{verb} {tables[0].strip(',;') if tables else ''}"
