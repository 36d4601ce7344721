"""What commands that change the ledger share: it is open, and the audit hears of it. A server may run beside."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from relume.errors import NotFoundError

if TYPE_CHECKING:
    from server.access.access import Access
    from server.settings import Settings
    from worker.service import BakeService
    from worker.status import BakeStatus

LEAST_OF_BAKE = 8  # characters that the id of a bake may be cut to


class Opened(NamedTuple):
    """A data folder: its settings, its bakes, which nothing here runs, and who may do what."""

    settings: Settings
    service: BakeService
    access: Access


@contextmanager
def opened(data: Path | None) -> Iterator[Opened]:
    """Open a data folder that relume has used. Raises ParameterError where it has not."""
    from cli.data_folder import check_used, open_bakes, open_settings
    from server.access.access import Access

    settings = open_settings(data)
    check_used(settings)
    service = open_bakes(settings)
    try:
        yield Opened(settings, service, Access(service.ledger.sessions, settings))
    finally:
        service.close()


def find_bakes(service: BakeService, name: str) -> list[BakeStatus]:
    """The bake of an id, or the start of one; else all of a scene, newest first. Raises NotFoundError.

    Args:
        service: where to look. name: what was typed.
    """
    from cli.data_folder import find_scene

    called = [bake for bake in service.bakes() if len(name) >= LEAST_OF_BAKE and bake.id.startswith(name)]
    if len(called) == 1:
        return called
    if called:
        raise NotFoundError(f"{len(called)} bakes begin with {name!r}; give more of the id")
    scene = find_scene(service.ledger, name)
    found = service.bakes(scene.id)
    if not found:
        raise NotFoundError(f"there is no bake of {scene.name!r} yet; run: relume bake {scene.id}")
    return found
