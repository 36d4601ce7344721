"""`relume ledger upgrade`: brings the ledger to the schema of this relume."""

from __future__ import annotations

import typer

from cli.options import Data


def ledger_upgrade(data: Data = None) -> None:
    """Upgrade the ledger for this relume, when no older one uses it; make a backup before.

    Servers do by themselves what only adds to a ledger; this does what they leave to people.
    """
    from cli.data_folder import open_settings
    from worker.database.opening import connect
    from worker.database.upgrading import newest_revision, upgrade

    engine = connect(open_settings(data).database_url)
    try:
        made = upgrade(engine, by_hand=True)
    finally:
        engine.dispose()
    for revision, what in made:
        typer.echo(f"{revision}: {what}")
    typer.echo(f"the ledger is at revision {newest_revision()}")
