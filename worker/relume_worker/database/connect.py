"""Open the database: SQLite, configured for several writing processes, or PostgreSQL."""

from __future__ import annotations

import sqlite3
import time
from pathlib import Path
from types import ModuleType
from typing import Any

from sqlalchemy import URL, Engine, create_engine, event
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError

from relume.core.errors import Description, ParameterError
from relume_worker.database.failures import translate_error, watch
from relume_worker.database.upgrading import upgrade

TLS_MODES = ("prefer", "require", "verify-full")  # libpq's names; the first is the default
BUSY_TIMEOUT_MS = 30_000
_RETRY_S = 0.01
POOL_TIMEOUT_S = 10.0
MAX_OVERFLOW = 30  # connections besides the five that stay open, for the server's threads


def open_database(url: str) -> Engine:
    """Return an engine for `url` with its tables created, or upgraded by additive revisions.

    Raises:
        ParameterError: `url` is neither SQLite nor PostgreSQL.
        DatabaseDamagedError, DiskFullError: the file cannot be used. LedgerVersionError: see `upgrading`.
    """
    engine = connect(url)
    try:
        upgrade(engine, is_requested=False)
    except Exception:
        engine.dispose()
        raise
    return engine


def connect(url: str) -> Engine:
    """Return an engine for `url` with its tables unchanged. Raises ParameterError."""
    database_url = _parse(url)
    if database_url.get_backend_name() == "postgresql":
        connect_postgresql = _import_driver().connect_postgresql
        waits = {"pool_timeout": POOL_TIMEOUT_S, "max_overflow": MAX_OVERFLOW}
        engine = create_engine(database_url, pool_pre_ping=True, **waits)
        watch(engine)
        event.listen(engine, "do_connect", connect_postgresql)
    else:
        if database_url.database:
            Path(database_url.database).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            Path(database_url.database).touch(mode=0o600)  # SQLite would make it readable by everyone
        # SQLite keeps the file open for connections beyond the pool: its locks belong to the process
        engine = create_engine(database_url)
        event.listen(engine, "connect", _set_up_sqlite)
    event.listen(engine, "handle_error", translate_error)
    return engine


def _import_driver() -> ModuleType:
    """Module of PostgreSQL's connections, which needs an optional package."""
    try:
        from relume_worker.database import postgresql
    except ImportError:
        value = Description("a URL of PostgreSQL, whose driver is not installed")
        allowed = "one of SQLite, or install the driver: pip install relume[postgres]"
        raise ParameterError("RELUME_DATABASE", value, allowed) from None
    return postgresql


def _parse(url: str) -> URL:
    allowed = "a URL such as postgresql://user:password@host/name or sqlite:////folder/relume.db"
    try:
        database_url = make_url(url)
    except ArgumentError:
        raise ParameterError(
            "RELUME_DATABASE", Description("not a URL"), allowed
        ) from None  # it may contain a password
    if database_url.drivername == "sqlite":
        return database_url
    if database_url.drivername not in ("postgres", "postgresql", "postgresql+pg8000"):
        raise ParameterError("RELUME_DATABASE", database_url.drivername, allowed)
    if not (database_url.username and database_url.host):
        raise ParameterError("RELUME_DATABASE", Description("a URL without user or host"), allowed)
    if not (database_url.query.keys() <= {"sslmode"} and database_url.query.get("sslmode", TLS_MODES[0]) in TLS_MODES):
        value, options = Description("a URL with unknown options after ?"), f"sslmode={', '.join(TLS_MODES)}"
        raise ParameterError("RELUME_DATABASE", value, f"no options, or one of {options}")
    return database_url.set(drivername="postgresql+pg8000")


def _set_up_sqlite(connection: Any, _: object) -> None:
    """Use a write-ahead log: readers never wait for a writer, and writers wait for each other instead of failing."""
    connection.execute(f"PRAGMA busy_timeout = {BUSY_TIMEOUT_MS}")
    _enable_write_ahead_log(connection)
    for pragma in ("synchronous = NORMAL", "foreign_keys = ON"):
        connection.execute(f"PRAGMA {pragma}")


def _enable_write_ahead_log(connection: Any) -> None:
    """Switch a file to a write-ahead log; SQLite does not wait if two processes do it at once."""
    deadline_s = time.monotonic() + BUSY_TIMEOUT_MS / 1e3
    while True:
        try:
            connection.execute("PRAGMA journal_mode = WAL")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode != sqlite3.SQLITE_BUSY or time.monotonic() > deadline_s:
                raise
            time.sleep(_RETRY_S)
        else:
            return
