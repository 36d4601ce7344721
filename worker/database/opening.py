"""Opens the database: any SQLAlchemy URL; SQLite is set up for several processes that write."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sqlalchemy import Column, Connection, Engine, MetaData, Table, create_engine, event, inspect, text
from sqlalchemy.engine import make_url
from sqlalchemy.exc import DBAPIError

from worker.database.faults import name_fault
from worker.database.models import Base

BUSY_TIMEOUT_MS = 30_000
CREATE_ATTEMPTS = 5


def open_database(url: str) -> Engine:
    """An engine on `url`, its tables made where they are missing. Raises DatabaseDamagedError, DiskFullError."""
    parsed = make_url(url)
    sqlite = parsed.get_backend_name() == "sqlite"
    if sqlite and parsed.database:
        Path(parsed.database).parent.mkdir(parents=True, exist_ok=True)
    engine = create_engine(parsed, pool_pre_ping=not sqlite)
    event.listen(engine, "handle_error", name_fault)
    if sqlite:
        event.listen(engine, "connect", _set_up_sqlite)
    create_tables(engine, Base.metadata)
    add_columns(engine, Base.metadata)
    return engine


def add_columns(engine: Engine, metadata: MetaData) -> None:
    """Add the columns that tables of an older relume lack; they are empty there. Two processes may do so at once."""
    for attempt in range(CREATE_ATTEMPTS):
        try:
            with engine.begin() as connection:
                for table, column in _lacking(connection, metadata):
                    kind = column.type.compile(engine.dialect)
                    connection.execute(text(f"ALTER TABLE {table.name} ADD COLUMN {column.name} {kind}"))
            return
        except DBAPIError:
            if attempt == CREATE_ATTEMPTS - 1:
                raise


def _lacking(connection: Connection, metadata: MetaData) -> Iterator[tuple[Table, Column[Any]]]:
    for table in metadata.sorted_tables:
        known = {column["name"] for column in inspect(connection).get_columns(table.name)}
        yield from ((table, column) for column in table.columns if column.name not in known and column.nullable)


def create_tables(engine: Engine, metadata: MetaData) -> None:
    """Make the tables that are missing. Two processes may find them missing at once; the later one looks again."""
    for attempt in range(CREATE_ATTEMPTS):
        try:
            metadata.create_all(engine)
            return
        except DBAPIError:
            if attempt == CREATE_ATTEMPTS - 1:
                raise


def _set_up_sqlite(connection: Any, _: object) -> None:
    """Write-ahead log: readers never wait for a writer. Writers wait for each other instead of failing."""
    for pragma in (
        f"busy_timeout = {BUSY_TIMEOUT_MS}",
        "journal_mode = WAL",
        "synchronous = NORMAL",
        "foreign_keys = ON",
    ):
        connection.execute(f"PRAGMA {pragma}")
