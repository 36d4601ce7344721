"""`relume db draft`: begins a revision, for developers who change relume's tables."""

from __future__ import annotations

import tempfile
from typing import Annotated

import typer


def db_draft(
    message: Annotated[str, typer.Argument(metavar="MESSAGE", help="What the revision does, in a few words.")],
) -> None:
    """For developers: write the next revision of the tables.

    It brings the newest one to the tables of the code; look it through.
    """
    import relume_server.auth.tables  # the server's, beside the worker's
    import relume_server.persistence.tables  # noqa: F401
    from relume_worker.database import open_database
    from relume_worker.database.models import Base
    from relume_worker.database.upgrading import draft_revision

    with tempfile.TemporaryDirectory() as folder:
        engine = open_database(f"sqlite:///{folder}/relume.db")
        with engine.begin() as connection:
            typer.echo(draft_revision(connection, Base.metadata, message))
        engine.dispose()
