"""Brings a database to the newest revision of its schema, by Alembic; see docs/adr/0029-database-revisions.md.

Revisions that only add are made when a database is opened: relumes from before them work on beside. Others wait until
somebody says `relume db upgrade`.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import Script, ScriptDirectory
from sqlalchemy import Connection, Engine, text

from relume.core.errors import LedgerVersionError

logging.getLogger("alembic").setLevel(logging.WARNING)  # what is made, whoever upgrades says
REVISIONS = Path(__file__).with_name("revisions")
_LOCK = 0x72656C756D65  # of PostgreSQL, by its number; "relume"

RevisionNote = tuple[str, str]
"""Name of a revision, and what it does."""


def get_revision(connection: Connection) -> str | None:
    """The revision that a database has; None where it is empty, or from before there were any."""
    return MigrationContext.configure(connection).get_current_revision()


def latest_revision() -> str:
    """The revision that this relume works with."""
    (head,) = _scripts().get_heads()
    return head


def upgrade(engine: Engine, *, is_requested: bool) -> list[RevisionNote]:
    """Make all revisions that a database lacks, in one transaction; of several processes one makes them.

    Args:
        engine: of the database.
        is_requested: whether somebody asked for it, so that no older relume is at work; else only what adds is made.
    Returns:
        The revisions that were made.
    Raises:
        LedgerVersionError: a newer relume has upgraded the database, or one that only people may make is lacking.
    """
    with engine.connect() as connection:
        if not _missing_revisions(connection):
            return []
    with _exclusive_transaction(engine) as connection:
        missing = _missing_revisions(connection)
        if not is_requested and not all(script.module.is_additive for script in missing):
            raise LedgerVersionError(
                "the ledger is to be changed in a way that relumes from before cannot work with; stop all that use it, "
                "run: relume backup FOLDER, then: relume db upgrade"
            )
        config = _config()
        config.attributes["connection"] = connection
        command.upgrade(config, "head")
        return [(script.revision, script.doc.rstrip(".")) for script in missing]


def draft_revision(connection: Connection, metadata: object, message: str) -> Path:
    """Write a revision, to be looked through, that makes what the code's tables have and a database lacks.

    Args:
        connection: to a database of the newest revision. metadata: of the code's tables.
        message: what it does, in a few words.
    Returns:
        The file.
    """
    config = _config()
    config.attributes.update(connection=connection, metadata=metadata)
    number = f"{int(latest_revision()) + 1:04d}"
    script = command.revision(config, message, autogenerate=True, rev_id=number)
    assert isinstance(script, Script)
    return Path(script.path)


def _config() -> Config:
    config = Config()
    config.set_main_option("script_location", str(REVISIONS).replace("%", "%%"))
    config.set_main_option("file_template", "%%(rev)s_%%(slug)s")
    return config


@cache
def _scripts() -> ScriptDirectory:
    return ScriptDirectory.from_config(_config())


def _missing_revisions(connection: Connection) -> list[Script]:
    """Revisions from a database's own to the newest, in order."""
    current, revisions = get_revision(connection), list(_scripts().walk_revisions())
    names = [script.revision for script in revisions]
    if current is not None and current not in names:
        raise LedgerVersionError(
            f"the ledger was upgraded by a newer relume (revision {current[:40]}, this one knows {names[0]}); "
            "run that relume, or restore a backup from before"
        )
    return revisions[: names.index(current) if current is not None else None][::-1]


@contextmanager
def _exclusive_transaction(engine: Engine) -> Iterator[Connection]:
    """A transaction in which nobody else changes the schema."""
    with engine.connect() as connection:
        if engine.dialect.name != "sqlite":
            with connection.begin():
                connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _LOCK})
                yield connection
            return
        connection.detach()  # others get connections that check foreign keys
        connection.exec_driver_sql("PRAGMA foreign_keys = OFF")  # tables that are made anew drop the old for a moment
        connection.commit()
        with connection.begin():
            connection.exec_driver_sql("BEGIN IMMEDIATE")
            yield connection
            if connection.exec_driver_sql("PRAGMA foreign_key_check").first() is not None:
                raise LedgerVersionError("rows of the ledger would name others that are not there; nothing was changed")
