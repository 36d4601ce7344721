"""`relume db upgrade`: upgrade the database to the schema of this version."""

from __future__ import annotations

from relume_cli.options import Data
from relume_cli.terminal.printing import Json, print_result


def db_upgrade(as_json: Json = False, data: Data = None) -> None:
    """Upgrade the database to this version; back up first.

    Older versions of relume cannot use it afterwards. Servers apply additive revisions by themselves; this command
    applies the others.
    """
    from relume_cli.data_folder import open_settings
    from relume_worker.database.connect import connect
    from relume_worker.database.upgrading import latest_revision, upgrade

    engine = connect(open_settings(data).database_url)
    try:
        revisions = upgrade(engine, is_requested=True)
    finally:
        engine.dispose()
    document = {"revision": latest_revision(), "made": [revision for revision, _ in revisions]}
    lines = [
        *(f"{revision}: {description}" for revision, description in revisions),
        f"the database is at revision {latest_revision()}",
    ]
    print_result(document, "\n".join(lines), as_json=as_json)
