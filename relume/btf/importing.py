"""BTFs of files: read, compressed, kept. One that was begun goes on."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from relume.btf.begun import Begun
from relume.btf.compress import Images, compress
from relume.btf.container import FIRST_BYTE
from relume.btf.eigen import EigenBtf
from relume.btf.factored import FactoredBtf
from relume.btf.shelf import STORE, BtfRecord, keep
from relume.btf.zips import ZippedBtf
from relume.errors import MaterialError


def import_btf(
    folder: Path,
    file: Path,
    name: str,
    bound: float,
    progress: Callable[[float], object],
    cancelled: Callable[[], bool],
    making: Path | None = None,
    images: Images | None = None,
) -> BtfRecord:
    """Import a zip of images or a .btf container; the same again is the same BTF.

    Args:
        folder: of the asset store. file: what is in it says which of them it is. name: what people call it.
        bound: relative RMS that may be missed. progress: called with the share done. cancelled: asked now and then.
        making: folder of what was found so far; by default in `folder`, by the file's content.
        images: of the file, where somebody else reads it.
    Raises:
        MaterialError: it is no such file, or the store is full. CancelledError: `cancelled` said so; what was found
            stays.
    """
    images = images or images_of(file)
    making = making or folder / "making" / STORE.identity_of(file)
    begun = Begun(making, {"bound": bound})

    def make() -> EigenBtf:
        try:
            return compress(images, bound, progress, cancelled, begun)
        except MaterialError:  # the file's own fault: nothing could go on from here
            shutil.rmtree(making, ignore_errors=True)
            raise

    record = keep(folder, file, name, None, make)
    shutil.rmtree(making, ignore_errors=True)
    return record


def images_of(file: Path) -> ZippedBtf | FactoredBtf:
    """The images of a zip or of a .btf container. Raises MaterialError."""
    with file.open("rb") as begun:
        is_container = begun.read(1) == FIRST_BYTE
    return FactoredBtf(file) if is_container else ZippedBtf(file)
