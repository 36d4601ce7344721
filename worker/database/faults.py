"""What the database says when it fails, in words; and loops that go on meanwhile and say each fault once."""

from __future__ import annotations

import logging
import sqlite3
import threading

import pg8000
from sqlalchemy.engine import ExceptionContext
from sqlalchemy.exc import DBAPIError, IntegrityError, OperationalError, SQLAlchemyError

from relume.errors import DatabaseDamagedError, DiskFullError, RelumeError

log = logging.getLogger(__name__)

AWAY = (SQLAlchemyError, DatabaseDamagedError, DiskFullError)
"""What reading or writing the database raises while it is away, damaged, or without room."""

MAX_TOLD = 300  # characters
_DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_NO_ROOM = "53100"  # of PostgreSQL, as are these: connections that fail, ends by an operator, too many clients
_NO_ANSWER = ("08", "57P", "53300")
_REFUSED_ROW = "23"


def name_fault(context: ExceptionContext) -> None:
    """Raise what a failure of the database means where that is known; listens to `handle_error` of an engine.

    Raises:
        DiskFullError, DatabaseDamagedError: it is one of these.
        OperationalError, IntegrityError: a server does not answer, or refuses a row; pg8000 calls them otherwise.
    """
    cause = context.original_exception
    code = getattr(cause, "sqlite_errorcode", 0) & 0xFF  # the rest tells kinds of it apart
    if code == sqlite3.SQLITE_FULL or _state(cause) == _NO_ROOM:
        raise DiskFullError("the database") from cause
    if code in _DAMAGED:
        raise DatabaseDamagedError(str(cause)) from cause
    statement, values, is_lost = context.statement, context.parameters, context.is_disconnect
    if _is_silent(cause):
        raise OperationalError(statement, values, cause, connection_invalidated=is_lost) from cause
    if _state(cause).startswith(_REFUSED_ROW):
        raise IntegrityError(statement, values, cause) from cause


def is_away(error: Exception) -> bool:
    """Whether a database server does not answer, so that asking again in a while may help."""
    return isinstance(error, DBAPIError) and _is_silent(error.orig)


def away_elsewhere(line: str) -> OperationalError:
    """What another process met, as it would have been met here. line: as `told` puts it."""
    return OperationalError(None, None, pg8000.InterfaceError(line))


def told(error: Exception) -> str:
    """A failure in one line."""
    cause = error.orig if isinstance(error, DBAPIError) and error.orig is not None else error
    return " ".join(_reply(cause).get("M", str(cause)).split()) or type(cause).__name__


def _reply(cause: BaseException | None) -> dict[str, str]:
    """The fields of a PostgreSQL's error message, by their letters; empty where it has not answered."""
    fields = cause.args[0] if isinstance(cause, pg8000.Error) and cause.args else None
    return fields if isinstance(fields, dict) else {}


def _state(cause: BaseException | None) -> str:
    """SQLSTATE; empty where there is none."""
    return _reply(cause).get("C", "")


def _is_silent(cause: BaseException | None) -> bool:
    state = _state(cause)
    return state.startswith(_NO_ANSWER) if state else isinstance(cause, pg8000.InterfaceError)


class Complaint:
    """Says what a loop meets in one line, and not again until it has gone or another has come; from any thread.

    A database server that is away is said once for the whole process, however many loops meet that.

    Args:
        log: where. what: cannot be done, as a sentence begins.
        asks_database: whether the loop does, so that all is well with that where all is well here.
    """

    def __init__(self, log: logging.Logger, what: str, asks_database: bool = True) -> None:
        self._log, self._what, self._asks_database = log, what, asks_database
        self._lock = threading.Lock()
        self._said = ""

    def meet(self, error: Exception) -> None:
        """Something failed; what nobody foresaw is told with its trace."""
        if is_away(error):
            database_away.meet(error)
            return
        line, is_known = told(error), isinstance(error, (*AWAY, RelumeError, OSError))
        with self._lock:
            if line == self._said:
                return
            self._said = line
        self._log.error("%s (%s); trying again", self._what, line, exc_info=None if is_known else error)

    def well(self) -> None:
        """It works."""
        if self._asks_database:
            database_away.well()
        with self._lock:
            was_said, self._said = self._said, ""
        if was_said:
            self._log.warning("%s: that is over", self._what)


class Absence:
    """Says that a server does not answer, and that it does again: whatever the reasons are meanwhile.

    Args:
        log: where. what: does not answer.
    """

    def __init__(self, log: logging.Logger, what: str) -> None:
        self._log, self._what = log, what
        self._is_said, self._lock = False, threading.Lock()

    def meet(self, error: Exception) -> None:
        """It did not."""
        with self._lock:
            was_said, self._is_said = self._is_said, True
        if not was_said:
            self._log.error("%s does not answer (%s); trying again", self._what, told(error)[:MAX_TOLD])

    def well(self) -> None:
        """It did."""
        with self._lock:
            was_said, self._is_said = self._is_said, False
        if was_said:
            self._log.warning("%s does not answer: that is over", self._what)


database_away = Absence(log, "the database")
