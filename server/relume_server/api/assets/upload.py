"""Import an uploaded asset: quota, a slot, a separate process, ownership."""

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
    kind: Literal["environment", "image", "ies", "lut", "material", "imported"],
    reservation: Reservation,
    services: Services,
) -> str:
    """Store an upload, and return its id.

    Args:
        file: file of the upload. name: given name; empty: the file's. kind: kind of the asset.
        reservation: reservation of its bytes.
    """
    called = check_name(name or plain_stem(file.filename) or kind.capitalize())

    def make_request(folder: Path) -> ImportRequest:
        path = save_upload(file, folder / kind)
        return ImportRequest.create(services.settings, kind, path, called, scene=plain_name(file.filename))

    return await services.import_queue.import_file(reservation, make_request)
