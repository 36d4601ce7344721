"""Copy a ledger of any database into one SQLite file, from which either kind can be restored."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection, Engine, MetaData, Table, func, insert, select

from relume_worker.database import open_database

ROWS_PER_BATCH = 1000


def copy_ledger(source: Engine, path: Path) -> None:
    """Copy all rows as of one moment, while the ledger is in use.

    Args:
        source: ledger of the newest revision.
        path: path of the file, which must not exist.
    """
    target = open_database(f"sqlite:///{path}")
    try:
        with _snapshot_connection(source) as source_connection, target.begin() as target_connection:
            _copy_rows(source_connection, target_connection)
        with target.connect() as connection:  # a single file, without a write-ahead log
            connection.exec_driver_sql("PRAGMA journal_mode = DELETE")
    finally:
        target.dispose()


def fill_ledger(path: Path, target: Engine) -> None:
    """Fill an empty ledger with the rows of a copy, all or none.

    Args:
        path: path of the copy; upgraded if it is of an older version. target: ledger of the newest revision.
    """
    source = open_database(f"sqlite:///{path}")
    try:
        with _snapshot_connection(source) as source_connection, target.begin() as target_connection:
            _copy_rows(source_connection, target_connection)
    finally:
        source.dispose()


def is_empty(engine: Engine) -> bool:
    """True if a ledger has no rows."""
    with _snapshot_connection(engine) as connection:
        return not any(connection.scalar(select(func.count()).select_from(table)) for table in _tables(connection))


def _tables(connection: Connection) -> list[Table]:
    """Tables of a ledger, referenced ones first."""
    metadata = MetaData()
    metadata.reflect(connection)
    return [table for table in metadata.sorted_tables if table.name != "alembic_version"]


def _copy_rows(source: Connection, target: Connection) -> None:
    sources = {table.name: table for table in _tables(source)}
    for table in _tables(target):
        columns = [sources[table.name].c[column.name] for column in table.columns]
        for rows in source.execute(select(*columns)).mappings().partitions(ROWS_PER_BATCH):
            target.execute(insert(table), [dict(row) for row in rows])


@contextmanager
def _snapshot_connection(engine: Engine) -> Iterator[Connection]:
    """Open a read-only connection that sees all tables at one moment."""
    with engine.connect() as connection:
        if engine.dialect.name == "sqlite":
            connection.exec_driver_sql("BEGIN")  # the driver begins a transaction only for writing
        else:
            connection = connection.execution_options(isolation_level="REPEATABLE READ")
        yield connection
        connection.rollback()
