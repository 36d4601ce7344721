"""What a file that is sent for a shelf goes through: whoever reads it, its slot, and whose it is then."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from fastapi import UploadFile

from relume.asset_store import check_name
from server.access.reservations import Reservation
from server.files.importing import ImportRequest
from server.files.uploads import keep_upload, plain_name, plain_stem
from server.services import Services


async def take_in(
    file: UploadFile,
    name: str,
    kind: Literal["environment", "image", "material"],
    reservation: Reservation,
    services: Services,
) -> str:
    """Keep what was sent, and return its id.

    Args:
        file: that was sent. name: that was given; empty: the file's. kind: of thing that it is.
        reservation: what it may take.
    """
    called = check_name(name or plain_stem(file.filename) or kind.capitalize())

    def order(folder: Path) -> ImportRequest:
        path = keep_upload(file, folder / kind)
        return ImportRequest.of(services.settings, kind, path, called, scene=plain_name(file.filename))

    return await services.intake.take(reservation, order)
