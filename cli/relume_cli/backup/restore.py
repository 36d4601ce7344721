"""`relume restore`: restore a backup into an empty data directory."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relume_cli.backup.backup import print_snapshot
from relume_cli.options import Data
from relume_cli.terminal.printing import Json
from relume_cli.tokens import open_access

if TYPE_CHECKING:
    from relume_server.auth.services import AuthServices


def restore(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder that relume backup wrote.")],
    snapshot: Annotated[
        str | None, typer.Option(metavar="NAME", help="Backup to restore. [default: the newest]")
    ] = None,
    revoke_tokens: Annotated[
        bool,
        typer.Option("--revoke-tokens", help="Revoke all tokens, because some may have been revoked after the backup."),
    ] = False,
    as_json: Json = False,
    data: Data = None,
) -> int:
    """Restore a backup into an empty data directory.

    Into an empty database, too: SQLite or PostgreSQL. Every file is verified. If it is interrupted, run it again: it
    resumes. Until it is complete, no relume process uses the directory.
    """
    from relume_cli.backup.transfer_bar import transfer_bar
    from relume_cli.data_folder import open_settings, private_files
    from relume_worker.backup.repository import BackupRepository
    from relume_worker.backup.restore import restore as restore_into

    settings = open_settings(data)
    with transfer_bar("restoring") as start_report, private_files():
        restored, damaged_files = restore_into(
            BackupRepository(folder), snapshot, settings.data.resolve(), settings.database_url, start_report
        )
    print_snapshot(restored, [*restored.left_out, *damaged_files], as_json=as_json)
    for sentence in restored.left_out:
        typer.echo(f"not in the backup: {sentence}", err=True)
    for sentence in damaged_files:
        typer.echo(f"not restored: {sentence}", err=True)
    _report_tokens(open_access(data), revoke_tokens)
    return 1 if damaged_files else 0


def _report_tokens(access: AuthServices, revokes_tokens: bool) -> None:
    """Print the valid tokens: those that were revoked after the backup are valid again."""
    now = time.time()
    for token in access.tokens.all():
        if not token.is_valid(now):
            continue
        if revokes_tokens:
            access.tokens.revoke(token.id)
        typer.echo(f"{'revoked' if revokes_tokens else 'valid'}: token {token.name}, {token.role.label}", err=True)
