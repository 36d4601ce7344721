"""Upgrade a database to the newest revision of its schema with Alembic; see docs/adr/0029-database-revisions.md.

Additive revisions are applied when a database is opened: older versions of relume keep working on it. Others wait for
`relume db upgrade`.
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

logging.getLogger("alembic").setLevel(logging.WARNING)  # the caller reports the revisions
REVISIONS = Path(__file__).with_name("revisions")
_LOCK = 0x72656C756D65  # PostgreSQL's advisory lock key: "relume" in numbers

RevisionNote = tuple[str, str]
"""A revision's name, and its description."""


def get_revision(connection: Connection) -> str | None:
    """Revision of a database; None if it is empty, or older than revisions."""
    return MigrationContext.configure(connection).get_current_revision()


def latest_revision() -> str:
    """Newest revision of this version of relume."""
    (head,) = _scripts().get_heads()
    return head


def upgrade(engine: Engine, *, is_requested: bool) -> list[RevisionNote]:
    """Apply all missing revisions in one transaction; of several processes one applies them.

    Args:
        engine: engine of the database.
        is_requested: whether a user asked for it, so that no older version is running; otherwise only additive
            revisions.
    Returns:
        The applied revisions.
    Raises:
        LedgerVersionError: a newer relume has upgraded the database, or a revision needs a user's request.
    """
    with engine.connect() as connection:
        if not _missing_revisions(connection):
            return []
    with _exclusive_transaction(engine) as connection:
        missing = _missing_revisions(connection)
        if not is_requested and not all(script.module.is_additive for script in missing):
            raise LedgerVersionError(
                "the database needs an upgrade that older versions of relume cannot use; stop all relume processes, "
                "run: relume backup FOLDER, then: relume db upgrade"
            )
        config = _config()
        config.attributes["connection"] = connection
        command.upgrade(config, "head")
        return [(script.revision, script.doc.rstrip(".")) for script in missing]


def draft_revision(connection: Connection, metadata: object, message: str) -> Path:
    """Write a draft of the revision that changes a database into the code's tables.

    Args:
        connection: connection to a database of the newest revision. metadata: metadata of the code's tables.
        message: short description.
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
            f"the database was upgraded by a newer relume (revision {current[:40]}, this version has {names[0]}); "
            "run that relume, or restore a backup from before"
        )
    return revisions[: names.index(current) if current is not None else None][::-1]


@contextmanager
def _exclusive_transaction(engine: Engine) -> Iterator[Connection]:
    """Open a transaction that excludes other schema changes."""
    with engine.connect() as connection:
        if engine.dialect.name != "sqlite":
            with connection.begin():
                connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _LOCK})
                yield connection
            return
        connection.detach()  # other connections check foreign keys
        connection.exec_driver_sql("PRAGMA foreign_keys = OFF")  # recreated tables are missing for a moment
        connection.commit()
        with connection.begin():
            connection.exec_driver_sql("BEGIN IMMEDIATE")
            yield connection
            if connection.exec_driver_sql("PRAGMA foreign_key_check").first() is not None:
                raise LedgerVersionError(
                    "the upgrade would leave rows that reference missing ones; nothing was changed"
                )
