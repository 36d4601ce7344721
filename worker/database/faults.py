"""What the database says when it fails, in words; and loops that go on meanwhile and say each fault once."""

from __future__ import annotations

import logging
import sqlite3
import threading

from sqlalchemy.engine import ExceptionContext
from sqlalchemy.exc import DBAPIError, SQLAlchemyError

from relume.errors import DatabaseDamagedError, DiskFullError, RelumeError

AWAY = (SQLAlchemyError, DatabaseDamagedError, DiskFullError)
"""What reading or writing the database raises while it is away, damaged, or without room."""

_DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def name_fault(context: ExceptionContext) -> None:
    """Raise what a failure of SQLite means where that is known; listens to `handle_error` of an engine.

    Raises:
        DiskFullError, DatabaseDamagedError: it is one of these.
    """
    cause = context.original_exception
    code = getattr(cause, "sqlite_errorcode", 0) & 0xFF  # the rest tells kinds of it apart
    if code == sqlite3.SQLITE_FULL:
        raise DiskFullError("the database") from cause
    if code in _DAMAGED:
        raise DatabaseDamagedError(str(cause)) from cause


def told(error: Exception) -> str:
    """A failure in one line."""
    cause = error.orig if isinstance(error, DBAPIError) and error.orig is not None else error
    return " ".join(str(cause).split()) or type(cause).__name__


class Complaint:
    """Says what a loop meets in one line, and not again until it has gone or another has come; from any thread.

    Args:
        log: where. what: cannot be done, as a sentence begins.
    """

    def __init__(self, log: logging.Logger, what: str) -> None:
        self._log, self._what, self._lock = log, what, threading.Lock()
        self._said = ""

    def meet(self, error: Exception) -> None:
        """Something failed; what nobody foresaw is told with its trace."""
        line, is_known = told(error), isinstance(error, (*AWAY, RelumeError, OSError))
        with self._lock:
            if line == self._said:
                return
            self._said = line
        self._log.error("%s (%s); trying again", self._what, line, exc_info=None if is_known else error)

    def well(self) -> None:
        """It works."""
        with self._lock:
            was_said, self._said = self._said, ""
        if was_said:
            self._log.warning("%s: that is over", self._what)
