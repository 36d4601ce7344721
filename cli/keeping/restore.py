"""`relume restore`: puts a backup into an empty data folder."""

from __future__ import annotations

from typing import Annotated

import typer

from cli.keeping.backup import BackupFolder
from cli.options import Data


def restore(
    folder: BackupFolder,
    snapshot: Annotated[str | None, typer.Option(metavar="NAME", help="Which one; else the newest.")] = None,
    data: Data = None,
) -> int:
    """Restore a backup into an empty data folder and an empty ledger, of SQLite or PostgreSQL, all of it checked.

    An interrupted one is gone on with by the same command; until it is finished nothing works on the folder.
    """
    from cli.data_folder import open_settings
    from cli.keeping.transfer_bar import transfer_bar
    from worker.backup.restore import restore as restore_into
    from worker.backup.shelf import Shelf

    settings = open_settings(data)
    with transfer_bar("restoring") as begin:
        done, damaged = restore_into(Shelf(folder), snapshot, settings.data.resolve(), settings.database_url, begin)
    typer.echo(done.name)
    typer.echo(f"{len(done.files):,} files, {sum(kept.num_bytes for kept in done.all) / 1e6:,.1f} MB", err=True)
    for sentence in done.left_out:
        typer.echo(f"was left out: {sentence}", err=True)
    for sentence in damaged:
        typer.echo(f"left out: {sentence}", err=True)
    return 1 if damaged else 0
