"""Database errors as messages; background loops that survive them and log each once."""

from __future__ import annotations

import logging
import math
import sqlite3
import sys
import threading
import time

from sqlalchemy import Engine, event
from sqlalchemy.engine import ExceptionContext
from sqlalchemy.exc import DBAPIError, IntegrityError, OperationalError, SQLAlchemyError

from relume.core.errors import DatabaseDamagedError, DiskFullError, RelumeError

log = logging.getLogger(__name__)

DATABASE_ERRORS = (SQLAlchemyError, DatabaseDamagedError, DiskFullError)
"""Exceptions of a database that is unavailable, damaged, or full."""

MAX_MESSAGE_LENGTH = 300  # characters
_DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_DISK_FULL = "53100"  # PostgreSQL's codes: failed connections, operator shutdowns, too many clients
_UNAVAILABLE_STATES = ("08", "57P", "53300")
_INTEGRITY_CLASS = "23"


def translate_error(context: ExceptionContext) -> None:
    """Translate a database error into relume's exceptions; listens to `handle_error` of an engine.

    Raises:
        DiskFullError, DatabaseDamagedError: for these causes.
        OperationalError, IntegrityError: a server does not answer, or rejects a row; pg8000 raises other types.
    """
    cause = context.original_exception
    code = getattr(cause, "sqlite_errorcode", 0) & 0xFF  # the rest distinguishes subtypes
    if code == sqlite3.SQLITE_FULL or _state(cause) == _DISK_FULL:
        raise DiskFullError("the database") from cause
    if code in _DAMAGED:
        raise DatabaseDamagedError(str(cause)) from cause
    statement, values, is_lost = context.statement, context.parameters, context.is_disconnect
    if _is_unanswered(cause):
        raise OperationalError(statement, values, cause, connection_invalidated=is_lost) from cause
    if _state(cause).startswith(_INTEGRITY_CLASS):
        raise IntegrityError(statement, values, cause) from cause


def is_unavailable(error: Exception) -> bool:
    """True if a database server does not answer, so that retrying later may help."""
    return isinstance(error, DBAPIError) and _is_unanswered(error.orig)


def is_locked(error: Exception) -> bool:
    """True if other writers of a SQLite file were ahead for longer than the timeout, so that retrying helps."""
    return isinstance(error, DBAPIError) and getattr(error.orig, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_BUSY


def describe_error(error: BaseException) -> str:
    """Describe an error in one line."""
    cause = error.orig if isinstance(error, DBAPIError) and error.orig is not None else error
    return " ".join(_reply(cause).get("M", str(cause)).split()) or type(cause).__name__


def _reply(cause: BaseException | None) -> dict[str, str]:
    """Fields of a PostgreSQL error message by letter; empty if the server has not answered."""
    fields = cause.args[0] if cause is not None and _is_of_driver(cause, "Error") and cause.args else None
    return fields if isinstance(fields, dict) else {}


def _state(cause: BaseException | None) -> str:
    """SQLSTATE; empty if there is none."""
    return _reply(cause).get("C", "")


def _is_unanswered(cause: BaseException | None) -> bool:
    state = _state(cause)
    return state.startswith(_UNAVAILABLE_STATES) if state else _is_of_driver(cause, "InterfaceError")


def _is_of_driver(cause: BaseException | None, kind: str) -> bool:
    """True for an exception of pg8000, an optional package that is loaded with the first connection to PostgreSQL."""
    driver = sys.modules.get("pg8000")
    return driver is not None and isinstance(cause, getattr(driver, kind))


class DatabaseError:
    """Logs an error of a loop once, until it is over or another one occurs. Thread-safe.

    An unavailable database server is logged by `database_outage`, once for the whole process.

    Args:
        log: log to write to. label: start of the message, such as "x cannot be read".
    """

    def __init__(self, log: logging.Logger, label: str) -> None:
        self._log, self._label = log, label
        self._lock = threading.Lock()
        self._reported = ""

    def report_failure(self, error: Exception) -> None:
        """Report an error; an unexpected one is logged with its traceback."""
        if is_unavailable(error):
            return
        line, is_expected = describe_error(error), isinstance(error, (*DATABASE_ERRORS, RelumeError, OSError))
        with self._lock:
            if line == self._reported:
                return
            self._reported = line
        self._log.error("%s (%s); trying again", self._label, line, exc_info=None if is_expected else error)

    def report_recovered(self) -> None:
        """Report success."""
        with self._lock:
            was_reported, self._reported = self._reported, ""
        if was_reported:
            self._log.warning("%s: resolved", self._label)


class Outage:
    """Logs that a server does not answer, and that it answers again, whatever the causes meanwhile.

    Calls overlap: a slow call that began before the last change is ignored.

    Args:
        log: log to write to. label: label of the server.
    """

    def __init__(self, log: logging.Logger, label: str) -> None:
        self._log, self._label = log, label
        self._is_reported, self._changed_s, self._lock = False, -math.inf, threading.Lock()

    def report_failure(self, error: BaseException, began_s: float) -> None:
        """Report that a call that began at `began_s` (`time.monotonic`) got no answer."""
        if self._changes(True, began_s):
            self._log.error(
                "%s does not answer (%s); trying again", self._label, describe_error(error)[:MAX_MESSAGE_LENGTH]
            )

    def report_recovered(self, began_s: float) -> None:
        """Report that a call that began at `began_s` (`time.monotonic`) was answered."""
        if self._changes(False, began_s):
            self._log.warning("%s answers again", self._label)

    def _changes(self, is_away: bool, began_s: float) -> bool:
        with self._lock:
            if self._is_reported == is_away or began_s < self._changed_s:
                return False
            self._is_reported, self._changed_s = is_away, time.monotonic()
            return True


database_outage = Outage(log, "the database")


class _CallStart(threading.local):
    """Time at which this thread's last database call began."""

    time_s = -math.inf


_call_start = _CallStart()


def watch(engine: Engine) -> None:
    """Report answered and failed calls of an engine to `database_outage`."""

    def begin(*_: object) -> None:
        _call_start.time_s = time.monotonic()

    def report_answer(*_: object) -> None:
        database_outage.report_recovered(_call_start.time_s)

    def report_error(context: ExceptionContext) -> None:
        if _is_unanswered(context.original_exception):
            database_outage.report_failure(context.original_exception, _call_start.time_s)

    event.listen(engine, "do_connect", begin)
    event.listen(engine, "before_cursor_execute", begin)
    event.listen(engine, "after_cursor_execute", report_answer)
    event.listen(engine, "handle_error", report_error)
