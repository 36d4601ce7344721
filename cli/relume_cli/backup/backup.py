"""`relume backup`: add new data to a backup folder, or verify a backup."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relume.core.errors import bytes_text
from relume_cli.options import Data
from relume_cli.terminal.printing import Json, print_result

if TYPE_CHECKING:
    from relume_worker.backup.repository import BackupRepository, Snapshot

BackupFolder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Backup folder, best on another disk.")]


def backup(
    folder: BackupFolder,
    verify: Annotated[bool, typer.Option("--verify", help="Verify the newest backup instead: read all of it.")] = False,
    as_json: Json = False,
    data: Data = None,
) -> int:
    """Back up the database and all files.

    A running server need not stop. Contains scenes, bakes, looks, materials and renders. The first backup copies all
    files, later ones copy new files. If it is interrupted, run it again: it resumes.
    """
    from relume_cli.backup.transfer_bar import transfer_bar
    from relume_cli.data_folder import open_settings, private_files
    from relume_worker.backup.create import create_backup
    from relume_worker.backup.repository import BackupRepository
    from relume_worker.backup.restore import refuse_unfinished
    from relume_worker.database import open_database

    repository = BackupRepository(folder)
    if verify:
        return _verify(repository, as_json=as_json)
    settings = open_settings(data)
    refuse_unfinished(settings.data)
    ledger = open_database(settings.database_url)
    try:
        with transfer_bar("backing up") as start_report, private_files():
            snapshot = create_backup(settings.data.resolve(), ledger, repository, start_report)
    finally:
        ledger.dispose()
    print_snapshot(snapshot, [*snapshot.left_out], as_json=as_json)
    for sentence in snapshot.left_out:
        typer.echo(f"not in the backup: {sentence}", err=True)
    return 1 if snapshot.left_out else 0


def print_snapshot(snapshot: Snapshot, omitted: list[str], *, as_json: bool) -> None:
    """Print the name of a backup, its number of files and its size.

    Args:
        snapshot: the backup. omitted: one sentence for each file that was not copied.
        as_json: whether JSON was asked for.
    """
    num_bytes = sum(stored_file.num_bytes for stored_file in snapshot.all)
    document = {"name": snapshot.name, "files": len(snapshot.files), "bytes": num_bytes, "left_out": omitted}
    details = [f"{len(snapshot.files):,} files, {bytes_text(num_bytes)}"]
    print_result(document, snapshot.name, as_json=as_json, details=details)


def _verify(repository: BackupRepository, *, as_json: bool) -> int:
    from relume_cli.backup.transfer_bar import transfer_bar

    snapshot = repository.read()
    with transfer_bar("checking") as start_report:
        damaged_files = list(
            repository.find_damaged(snapshot, start_report(sum(stored_file.num_bytes for stored_file in snapshot.all)))
        )
    if as_json:
        document = {
            "name": snapshot.name,
            "files": len(snapshot.all),
            "damaged": [stored_file.path for stored_file in damaged_files],
        }
        print_result(document, "", as_json=True)
    for stored_file in damaged_files:
        typer.echo(f"damaged: {stored_file.path}", err=True)
    typer.echo(f"{snapshot.name}: {len(damaged_files)} of {len(snapshot.all):,} files are damaged", err=True)
    for stored_file in damaged_files:
        repository.quarantine(stored_file)
    if damaged_files:
        typer.echo("run relume backup again: files that are still in the data directory are copied again", err=True)
    return 1 if damaged_files else 0
