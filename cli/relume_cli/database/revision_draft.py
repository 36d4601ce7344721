"""`relume db draft`: write a new revision, for developers who change relume's tables."""

from __future__ import annotations

import tempfile
from typing import Annotated

import typer


def db_draft(
    message: Annotated[str, typer.Argument(metavar="MESSAGE", help="Short description of the revision.")],
) -> None:
    """For developers: write the next revision of the tables.

    It changes the newest revision into the tables of the code. Review it.
    """
    import relume_server.auth.tables  # registers the server's tables
    import relume_server.persistence.tables  # noqa: F401
    from relume_worker.database import open_database
    from relume_worker.database.models import Base
    from relume_worker.database.upgrading import draft_revision

    with tempfile.TemporaryDirectory() as folder:
        engine = open_database(f"sqlite:///{folder}/relume.db")
        with engine.begin() as connection:
            typer.echo(draft_revision(connection, Base.metadata, message))
        engine.dispose()
