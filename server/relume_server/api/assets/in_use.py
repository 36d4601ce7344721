"""What looks name is not deleted under those who show it."""

from __future__ import annotations

import json
import time
from pathlib import Path

from fastapi.concurrency import run_in_threadpool

from relume.assets.asset_store import AssetStore
from relume_server.auth.quotas import OwnedKind
from relume_server.errors import InUseError
from relume_server.services import Services

_MAX_NAMED = 3  # of what uses it, in a message


async def remove_unused(
    store: AssetStore, folder: Path, identity: str, kind: OwnedKind, services: Services, called: str | None = None
) -> None:
    """Remove a thing, whose it is too, that no saved look, link, session of this server or work under way names.

    Args:
        store, folder, identity: which thing, and where it is kept. kind: of it, in quotas. services: the server's.
        called: in messages, where its id says little.
    Raises:
        NotFoundError: it is not there. InUseError: it is named; nothing is removed.
    """
    quoted_id = f'"{store.prefix}{identity}"'
    looks = services.live.resumes.looks(time.monotonic())  # of the event loop

    def remove() -> None:
        store.path(folder, identity)  # whatever its files are like
        sessions = [bake for bake, document in looks if quoted_id in json.dumps(document)]
        _check_unused(called or f"{store.label} {identity}", quoted_id, services, sessions)
        store.remove(folder, identity)
        services.access.quotas.disown(kind, identity)

    await run_in_threadpool(remove)


def _check_unused(label: str, quoted_id: str, services: Services, sessions: list[str]) -> None:
    users = [f"look {name!r}" for name in services.looks.referencing(quoted_id)]
    users += [f"link {identity}" for identity in services.shares.referencing(quoted_id)]
    users += [f"a session of bake {bake}" for bake in sessions]
    for queue in (services.renders, services.comparisons):
        users += [f"{queue.noun} {work}" for work in queue.referencing(quoted_id)]
    if users:
        more = f" and {len(users) - _MAX_NAMED} more" if len(users) > _MAX_NAMED else ""
        raise InUseError(f"{label} is shown by {', '.join(users[:_MAX_NAMED])}{more}; change or delete these first")
