"""What commands that change the ledger share: it is open, and the audit hears of it. A server may run beside."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from relume.core.errors import NotFoundError

if TYPE_CHECKING:
    from relume_server.auth.services import AuthServices
    from relume_server.settings import Settings
    from relume_worker.service import BakeService
    from relume_worker.status import BakeStatus

MIN_BAKE_ID_LENGTH = 8  # characters that the id of a bake may be cut to


class OpenFolder(NamedTuple):
    """A data folder: its settings, its bakes, which nothing here runs, and who may do what."""

    settings: Settings
    service: BakeService
    access: AuthServices


@contextmanager
def open_data_folder(data: Path | None) -> Iterator[OpenFolder]:
    """Open a data folder that relume has used. Raises ParameterError where it has not."""
    from relume_cli.data_folder import check_used, open_bakes, open_settings
    from relume_server.auth.services import AuthServices

    settings = open_settings(data)
    check_used(settings)
    service = open_bakes(settings)
    try:
        yield OpenFolder(settings, service, AuthServices(service.ledger.sessions, settings))
    finally:
        service.close()


def find_bakes(service: BakeService, name: str) -> list[BakeStatus]:
    """The bake of an id, or the start of one; else all of a scene, newest first. Raises NotFoundError.

    Args:
        service: where to look. name: what was typed.
    """
    from relume_cli.data_folder import find_scene

    matches = [bake for bake in service.bakes() if len(name) >= MIN_BAKE_ID_LENGTH and bake.id.startswith(name)]
    if len(matches) == 1:
        return matches
    if matches:
        raise NotFoundError(f"{len(matches)} bakes begin with {name!r}; give more of the id")
    scene = find_scene(service.ledger, name)
    bakes = service.bakes(scene.id)
    if not bakes:
        raise NotFoundError(f"there is no bake of {scene.name!r} yet; run: relume bake {scene.id}")
    return bakes
