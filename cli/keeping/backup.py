"""`relume backup`: adds what is new to a folder of backups, or checks one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.options import Data
from cli.terminal.printing import Json, print_result, size_text

if TYPE_CHECKING:
    from worker.backup.shelf import Shelf, Snapshot

BackupFolder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of backups, on another disk.")]


def backup(
    folder: BackupFolder,
    verify: Annotated[bool, typer.Option("--verify", help="Read the newest backup again instead, all of it.")] = False,
    as_json: Json = False,
    data: Data = None,
) -> int:
    """Back up the ledger and all files, while a server goes on.

    Scenes, bakes, looks, materials and renders. The first time copies all, later ones what is new. An interrupted
    backup is none; run it again, and it goes on.
    """
    from cli.data_folder import open_settings, private_files
    from cli.keeping.transfer_bar import transfer_bar
    from worker.backup.restore import refuse_unfinished
    from worker.backup.shelf import Shelf
    from worker.backup.take import back_up
    from worker.database import open_database

    shelf = Shelf(folder)
    if verify:
        return _verify(shelf, as_json=as_json)
    settings = open_settings(data)
    refuse_unfinished(settings.data)
    ledger = open_database(settings.database_url)
    try:
        with transfer_bar("backing up") as begin, private_files():
            snapshot = back_up(settings.data.resolve(), ledger, shelf, begin)
    finally:
        ledger.dispose()
    print_snapshot(snapshot, [*snapshot.left_out], as_json=as_json)
    for sentence in snapshot.left_out:
        typer.echo(f"left out: {sentence}", err=True)
    return 1 if snapshot.left_out else 0


def print_snapshot(snapshot: Snapshot, left_out: list[str], *, as_json: bool) -> None:
    """Print the name of a backup, and how much is in it.

    Args:
        snapshot: the backup. left_out: sentences, of what is not in it, or did not come back.
        as_json: whether JSON was asked for.
    """
    num_bytes = sum(kept.num_bytes for kept in snapshot.all)
    document = {"name": snapshot.name, "files": len(snapshot.files), "bytes": num_bytes, "left_out": left_out}
    details = [f"{len(snapshot.files):,} files, {size_text(num_bytes)}"]
    print_result(document, snapshot.name, as_json=as_json, details=details)


def _verify(shelf: Shelf, *, as_json: bool) -> int:
    from cli.keeping.transfer_bar import transfer_bar

    snapshot = shelf.read()
    with transfer_bar("checking") as begin:
        damaged = list(shelf.damaged(snapshot, begin(sum(kept.num_bytes for kept in snapshot.all))))
    if as_json:
        document = {"name": snapshot.name, "files": len(snapshot.all), "damaged": [kept.path for kept in damaged]}
        print_result(document, "", as_json=True)
    for kept in damaged:
        typer.echo(f"damaged: {kept.path}", err=True)
    typer.echo(f"{snapshot.name}: {len(damaged)} of {len(snapshot.all):,} files are damaged", err=True)
    for kept in damaged:
        shelf.set_aside(kept)
    if damaged:
        typer.echo("back up again: what is still in the data folder is copied anew", err=True)
    return 1 if damaged else 0
