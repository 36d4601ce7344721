"""What a file that is sent for a shelf goes through: room for it, a slot, whoever reads it, and whose it is then."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from fastapi import UploadFile
from fastapi.concurrency import run_in_threadpool

from relume.asset_store import check_name
from relume.folders import folder_bytes
from server.access.quotas import Kind
from server.access.roles import Caller
from server.files.importing import UPLOAD_PREFIX, ImportRequest
from server.files.uploads import keep_upload, plain_stem, upload_bytes
from server.services import Services


async def take_in(
    file: UploadFile, caller: Caller, services: Services, kind: Kind, shelf: Path, keep: Callable[[], str]
) -> str:
    """Keep what was sent as something of the caller's.

    Args:
        file: that was sent. kind: of thing that it is. shelf: folder of the things of that kind.
        keep: reads it, in a thread, and returns the id under which it is kept.
    Returns:
        That id.
    """
    quotas = services.access.quotas
    await run_in_threadpool(quotas.check_bytes, caller.name, upload_bytes(file))
    async with services.import_slots:
        identity = await run_in_threadpool(keep)
    num_bytes = await run_in_threadpool(folder_bytes, shelf / identity)
    await run_in_threadpool(quotas.own, caller.name, kind, identity, num_bytes)
    return identity


def import_apart(file: UploadFile, name: str, kind: Literal["environment", "image"], services: Services) -> str:
    """Read what was sent in a process of its own, and return its id. name: that was given; empty: the file's."""
    settings = services.settings
    name = check_name(name or plain_stem(file.filename) or kind.capitalize())
    with tempfile.TemporaryDirectory(dir=settings.data, prefix=UPLOAD_PREFIX) as folder:
        return services.importers.run(ImportRequest.of(settings, kind, keep_upload(file, Path(folder) / kind), name))
