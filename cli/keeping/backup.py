"""`relume backup`: adds what is new to a folder of backups, or checks one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.options import Data

if TYPE_CHECKING:
    from worker.backup.shelf import Shelf

BackupFolder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of backups, on another disk.")]


def backup(
    folder: BackupFolder,
    verify: Annotated[bool, typer.Option("--verify", help="Read the newest backup again instead, all of it.")] = False,
    data: Data = None,
) -> int:
    """Back up the ledger, scenes, bakes, looks, materials and renders, while a server may go on.

    The first time copies all, later ones what is new. An interrupted backup is none; run it again, and it goes on.
    """
    from cli.data_folder import open_settings, private_files
    from cli.keeping.transfer_bar import transfer_bar
    from worker.backup.restore import refuse_unfinished
    from worker.backup.shelf import Shelf
    from worker.backup.take import back_up
    from worker.database import open_database

    shelf = Shelf(folder)
    if verify:
        return _verify(shelf)
    settings = open_settings(data)
    refuse_unfinished(settings.data)
    ledger = open_database(settings.database_url)
    try:
        with transfer_bar("backing up") as begin, private_files():
            snapshot = back_up(settings.data.resolve(), ledger, shelf, begin)
    finally:
        ledger.dispose()
    typer.echo(snapshot.name)
    typer.echo(f"{len(snapshot.files):,} files, {sum(kept.num_bytes for kept in snapshot.all) / 1e6:,.1f} MB", err=True)
    for sentence in snapshot.left_out:
        typer.echo(f"left out: {sentence}", err=True)
    return 1 if snapshot.left_out else 0


def _verify(shelf: Shelf) -> int:
    from cli.keeping.transfer_bar import transfer_bar

    snapshot = shelf.read()
    with transfer_bar("checking") as begin:
        damaged = list(shelf.damaged(snapshot, begin(sum(kept.num_bytes for kept in snapshot.all))))
    for kept in damaged:
        typer.echo(f"damaged: {kept.path}", err=True)
    typer.echo(f"{snapshot.name}: {len(damaged)} of {len(snapshot.all):,} files are damaged", err=True)
    for kept in damaged:
        shelf.set_aside(kept)
    if damaged:
        typer.echo("back up again: what is still in the data folder is copied anew", err=True)
    return 1 if damaged else 0
