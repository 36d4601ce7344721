"""Open a data directory, and find its bakes. A server may run at the same time."""

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


class OpenFolder(NamedTuple):
    """A data directory: settings, bake service (not started), and users with their rights."""

    settings: Settings
    service: BakeService
    access: AuthServices


@contextmanager
def open_data_folder(data: Path | None) -> Iterator[OpenFolder]:
    """Open a data directory that relume has used. Raises ParameterError if it has not."""
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
    """Return the bake of an id or the start of one, otherwise all bakes of a scene, newest first. Raises NotFoundError.

    Args:
        service: service of the data directory. name: as it was typed.
    """
    from relume_cli.data_folder import bakes_by_prefix, find_scene

    matches = bakes_by_prefix(service, name)
    if len(matches) == 1:
        return matches
    if matches:
        raise NotFoundError(f"{len(matches)} bake ids begin with {name!r}; give more characters")
    scene = find_scene(service.ledger, name)
    bakes = service.bakes(scene.id)
    if not bakes:
        raise NotFoundError(f"there is no bake of {scene.name!r} yet; run: relume bake {scene.id}")
    return bakes
