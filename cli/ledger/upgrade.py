"""`relume ledger upgrade`: brings the ledger to the schema of this relume."""

from __future__ import annotations

from cli.options import Data
from cli.terminal.printing import Json, print_result


def ledger_upgrade(as_json: Json = False, data: Data = None) -> None:
    """Upgrade the ledger for this relume; make a backup before.

    No older relume may use it any more. Servers do by themselves what only adds to a ledger; this does the rest.
    """
    from cli.data_folder import open_settings
    from worker.database.opening import connect
    from worker.database.upgrading import newest_revision, upgrade

    engine = connect(open_settings(data).database_url)
    try:
        made = upgrade(engine, by_hand=True)
    finally:
        engine.dispose()
    document = {"revision": newest_revision(), "made": [revision for revision, _ in made]}
    lines = [*(f"{revision}: {what}" for revision, what in made), f"the ledger is at revision {newest_revision()}"]
    print_result(document, "\n".join(lines), as_json=as_json)
