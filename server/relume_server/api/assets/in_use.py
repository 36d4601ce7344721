"""Refuse to delete assets that looks and scenes use."""

from __future__ import annotations

import json
import time
from pathlib import Path

from fastapi.concurrency import run_in_threadpool

from relume.assets.asset_store import AssetStore
from relume_server.auth.quotas import OwnedKind
from relume_server.errors import InUseError
from relume_server.services import Services
from relume_worker.scenes import scenes_referencing

_MAX_NAMED = 3  # number of users listed in a message


async def remove_unused(
    store: AssetStore, folder: Path, identity: str, kind: OwnedKind, services: Services, called: str | None = None
) -> None:
    """Delete an asset that no scene, saved look, share link, session of this server or running job uses.

    Args:
        store, folder, identity: store, folder and id of the asset. kind: kind of asset, for quotas.
        services: services of the server.
        called: name in messages; default: its id.
    Raises:
        NotFoundError: it does not exist. InUseError: it is in use; nothing is deleted.
    """
    quoted_id = f'"{store.prefix}{identity}"'
    looks = services.live.resumes.looks(time.monotonic())  # on the event loop's thread

    def remove() -> None:
        store.path(folder, identity)  # whatever its files contain
        sessions = [bake for bake, document in looks if quoted_id in json.dumps(document)]
        _check_unused(called or f"{store.label} {identity}", quoted_id, services, sessions)
        store.remove(folder, identity)
        services.access.quotas.disown(kind, identity)

    await run_in_threadpool(remove)


def _check_unused(label: str, quoted_id: str, services: Services, sessions: list[str]) -> None:
    users = [f"scene {name!r}" for name in scenes_referencing(services.bakes.ledger, quoted_id)]
    users += [f"look {name!r}" for name in services.looks.referencing(quoted_id)]
    users += [f"link {identity}" for identity in services.shares.referencing(quoted_id)]
    users += [f"a session of bake {bake}" for bake in sessions]
    for kind in (services.renders, services.comparisons):
        users += [f"{kind.name} {job}" for job in kind.referencing(quoted_id)]
    if users:
        more = f" and {len(users) - _MAX_NAMED} more" if len(users) > _MAX_NAMED else ""
        raise InUseError(f"{label} is used by {', '.join(users[:_MAX_NAMED])}{more}; change or delete these first")
