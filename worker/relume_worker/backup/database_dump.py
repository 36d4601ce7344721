"""A ledger as one file: of SQLite, whichever database it is a copy of, so that it can be restored into either."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection, Engine, MetaData, Table, func, insert, select

from relume_worker.database import open_database

ROWS_PER_BATCH = 1000


def copy_ledger(source: Engine, path: Path) -> None:
    """Copy all rows as they are at one moment; whoever uses the ledger goes on meanwhile.

    Args:
        source: a ledger of the newest revision.
        path: of the file, which is not there yet.
    """
    target = open_database(f"sqlite:///{path}")
    try:
        with _snapshot_connection(source) as source_connection, target.begin() as target_connection:
            _copy_rows(source_connection, target_connection)
        with target.connect() as connection:  # one file, nothing beside it
            connection.exec_driver_sql("PRAGMA journal_mode = DELETE")
    finally:
        target.dispose()


def fill_ledger(path: Path, target: Engine) -> None:
    """Put the rows of a copy into an empty ledger, all or none of them.

    Args:
        path: of the copy; upgraded where it is of an older relume. target: a ledger of the newest revision.
    """
    source = open_database(f"sqlite:///{path}")
    try:
        with _snapshot_connection(source) as source_connection, target.begin() as target_connection:
            _copy_rows(source_connection, target_connection)
    finally:
        source.dispose()


def is_empty(engine: Engine) -> bool:
    """Whether a ledger has no rows."""
    with _snapshot_connection(engine) as connection:
        return not any(connection.scalar(select(func.count()).select_from(table)) for table in _tables(connection))


def _tables(connection: Connection) -> list[Table]:
    """Tables of a ledger, those that others name first."""
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
    """A connection that sees all tables as they are at one moment, and writes nothing."""
    with engine.connect() as connection:
        if engine.dialect.name == "sqlite":
            connection.exec_driver_sql("BEGIN")  # the driver begins one for writing only
        else:
            connection = connection.execution_options(isolation_level="REPEATABLE READ")
        yield connection
        connection.rollback()
