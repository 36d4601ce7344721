"""Queue imports: run in a separate process, measure, count for the user, move into place."""

from __future__ import annotations

import json
import os
import shutil
import stat
import tempfile
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar

from fastapi.concurrency import run_in_threadpool

from relume.assets.asset_store import AssetStore
from relume.assets.environments.environment_store import STORE as ENVIRONMENTS
from relume.assets.ies.ies_store import IES_FILES
from relume.assets.measured.measured_store import STORE as MATERIALS
from relume.brdf.texture_slots import IMAGES
from relume.core.errors import RelumeError
from relume.core.folder_size import folder_bytes
from relume.imported_materials.material_store import STORE as IMPORTED
from relume.luts.lut_store import LUTS
from relume_server.auth.quotas import OwnedKind, Quotas
from relume_server.auth.reservations import MAX_CONCURRENT_IMPORTS, Reservation
from relume_server.io.fair_slots import Slots
from relume_server.io.import_processes import Importers, ImportTooLargeError
from relume_server.io.import_request import IES as IES_FOLDER
from relume_server.io.import_request import IMAGES as IMAGES_FOLDER
from relume_server.io.import_request import SUMMARY, UPLOAD_PREFIX, ImportRequest
from relume_worker.ledger import Ledger
from relume_worker.paths import (
    environments_path,
    ies_path,
    images_path,
    imported_materials_path,
    luts_path,
    materials_path,
    scene_path,
)
from relume_worker.scenes import insert_scene

if TYPE_CHECKING:
    from relume_server.settings import Settings

T = TypeVar("T")
_OUTPUT_FOLDER = "made"
MAX_SUMMARY_BYTES = 64 << 20
_STORES: Mapping[str, tuple[AssetStore, Callable[[Path], Path], OwnedKind]] = {
    "environment": (ENVIRONMENTS, environments_path, "environment"),
    "image": (IMAGES, images_path, "image"),
    "lut": (LUTS, luts_path, "lut"),
    "ies": (IES_FILES, ies_path, "ies"),
    "material": (MATERIALS, materials_path, "material"),
    "imported": (IMPORTED, imported_materials_path, "imported"),
}


class ImportQueue:
    """Imports for routes.

    Attributes:
        importers: run the processes.
    """

    def __init__(self, settings: Settings, ledger: Ledger, quotas: Quotas, importers: Importers) -> None:
        self._settings, self._ledger, self._quotas, self.importers = settings, ledger, quotas, importers
        self._slots = Slots(
            MAX_CONCURRENT_IMPORTS, 1 if settings.login else MAX_CONCURRENT_IMPORTS, settings.fair_shares
        )

    @asynccontextmanager
    async def reserving(self, owner: str, num_bytes: int) -> AsyncIterator[Reservation]:
        """Reserve space for something that is made, not uploaded. Raises QuotaError, NearlyFullError."""
        reservation = Reservation(self._quotas, owner)
        try:
            await run_in_threadpool(reservation.reserve, num_bytes)
            yield reservation
        finally:
            await run_in_threadpool(reservation.release)

    async def run_in_slot(self, client: str, work: Callable[[], T]) -> T:
        """Run work in a thread when the client gets an import slot."""
        async with self._slots.acquire(client):
            return await run_in_threadpool(work)

    async def import_file(self, reservation: Reservation, make_request: Callable[[Path], ImportRequest]) -> str:
        """Import a file, assign it to its owner, and return its id.

        Args:
            reservation: reservation of the upload.
            make_request: writes files into an empty folder, in a thread, and describes them.
        Raises:
            QuotaError, NearlyFullError: the unpacked result is too large; nothing is stored.
            Also what `Importers.run` raises.
        """
        return await self.run_in_slot(reservation.owner, lambda: self._import_file(reservation, make_request))

    def _import_file(self, reservation: Reservation, make_request: Callable[[Path], ImportRequest]) -> str:
        with tempfile.TemporaryDirectory(dir=self._settings.data, prefix=UPLOAD_PREFIX) as folder:
            request = make_request(Path(folder))
            identity = self.read(reservation, request, Path(folder))
            self._adopt(reservation, request, Path(folder) / _OUTPUT_FOLDER, identity)
        return identity

    def read(self, reservation: Reservation, request: ImportRequest, folder: Path) -> str:
        """Run an import within the reservation; its result is in the folder, too."""
        max_bytes, output_folder = reservation.max_import_bytes(), folder / _OUTPUT_FOLDER
        output_folder.mkdir()
        try:
            return self.importers.run(replace(request, into=str(output_folder), max_file_bytes=max_bytes))
        except ImportTooLargeError:
            raise reservation.too_large_error(max_bytes) from None

    def _adopt(self, reservation: Reservation, request: ImportRequest, into: Path, identity: str) -> None:
        store = _STORES.get(request.kind)
        target = scene_path(self._settings.data, identity)
        if store is not None:
            target = store[1](self._settings.data) / store[0].path(into, identity).name
        num_bytes = _checked_bytes(into / identity)
        if not target.exists():  # otherwise it takes no additional space
            reservation.reserve(num_bytes + folder_bytes(into / IMAGES_FOLDER) + folder_bytes(into / IES_FOLDER))
        self._adopt_assets(reservation.owner, "image", into / IMAGES_FOLDER)
        self._adopt_assets(reservation.owner, "ies", into / IES_FOLDER)
        if store is None:
            self._register_scene(into, identity, target)
        else:
            store[0].adopt(target.parent, into / identity)
        reservation.convert(store[2] if store else "scene", identity, num_bytes)

    def _adopt_assets(self, owner: str, kind: Literal["image", "ies"], folder: Path) -> None:
        """Move images of imported materials, or IES files of scenes, into place, and assign them to their owner."""
        store, folder_of, owned_kind = _STORES[kind]
        target = folder_of(self._settings.data)
        for path in store.paths(folder):
            store.adopt(target, path)
            self._quotas.assign_owner(owner, owned_kind, path.name, folder_bytes(target / path.name))

    def _register_scene(self, into: Path, identity: str, target: Path) -> None:
        """Move a scene into place; an existing damaged one is replaced."""
        with (into / SUMMARY).open("rb") as file:
            summary = json.loads(file.read(MAX_SUMMARY_BYTES))
        is_new = not target.exists()
        target.mkdir(parents=True, exist_ok=True)
        for name in ("arrays.npz", "scene.json"):
            os.replace(into / identity / name, target / name)
        try:
            insert_scene(self._settings.data, self._ledger, identity, summary)
        except Exception:
            if is_new:  # otherwise unreachable
                shutil.rmtree(target, ignore_errors=True)
            raise


def _checked_bytes(folder: Path) -> int:
    """Size of the files that another process has written. Raises RelumeError for anything but regular files."""
    num_bytes = 0
    for path in folder.rglob("*"):
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode) and not stat.S_ISDIR(status.st_mode):
            raise RelumeError("the import wrote something other than a regular file; report the uploaded file")
        num_bytes += status.st_size
    return num_bytes
