"""`relume db upgrade`: brings the database to the schema of this relume."""

from __future__ import annotations

from relume_cli.options import Data
from relume_cli.terminal.printing import Json, print_result


def db_upgrade(as_json: Json = False, data: Data = None) -> None:
    """Upgrade the database for this relume; make a backup before.

    Older versions of relume can no longer use it. Servers apply additive revisions by themselves; this applies the
    others.
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
