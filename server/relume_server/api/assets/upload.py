"""What a file that is sent for a shelf goes through: whoever reads it, its slot, and whose it is then."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from fastapi import UploadFile

from relume.assets.asset_store import check_name
from relume_server.auth.reservations import Reservation
from relume_server.io.import_request import ImportRequest
from relume_server.io.uploads import plain_name, plain_stem, save_upload
from relume_server.services import Services


async def store_upload(
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

    def make_request(folder: Path) -> ImportRequest:
        path = save_upload(file, folder / kind)
        return ImportRequest.create(services.settings, kind, path, called, scene=plain_name(file.filename))

    return await services.intake.import_file(reservation, make_request)
