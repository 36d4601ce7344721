"""BTFs of files: read, compressed, kept. One that was begun goes on."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from relume.assets.btf.bonn_container import FIRST_BYTE
from relume.assets.btf.bonn_zip import ZippedBtf
from relume.assets.btf.btf_store import STORE, BtfRecord, store_btf
from relume.assets.btf.compress import ViewArrays, compress
from relume.assets.btf.local_pca_btf import LocalPcaBtf
from relume.assets.btf.matrix_btf import MatrixBtf
from relume.assets.btf.partial_results import PartialCompression
from relume.core.errors import MaterialError


def import_btf(
    folder: Path,
    file: Path,
    name: str,
    bound: float,
    progress: Callable[[float], object],
    is_canceled: Callable[[], bool],
    partial_folder: Path | None = None,
    images: ViewArrays | None = None,
) -> BtfRecord:
    """Import a zip of images or a .btf container; the same again is the same BTF.

    Args:
        folder: of the asset store. file: what is in it says which of them it is. name: what people call it.
        bound: relative RMS that may be missed. progress: called with the share done. is_canceled: asked now and then.
        partial_folder: folder of what was found so far; by default in `folder`, by the file's content.
        images: of the file, where somebody else reads it.
    Raises:
        MaterialError: it is no such file, or the store is full. CancelledError: `is_canceled` said so; what was found
            stays.
    """
    images = images or open_images(file)
    partial_folder = partial_folder or folder / "making" / STORE.content_id(file)
    partial_compression = PartialCompression(partial_folder, {"bound": bound})

    def compress_images() -> LocalPcaBtf:
        try:
            return compress(images, bound, progress, is_canceled, partial_compression)
        except MaterialError:  # the file's own fault: nothing could go on from here
            shutil.rmtree(partial_folder, ignore_errors=True)
            raise

    record = store_btf(folder, file, name, None, compress_images)
    shutil.rmtree(partial_folder, ignore_errors=True)
    return record


def open_images(file: Path) -> ZippedBtf | MatrixBtf:
    """The images of a zip or of a .btf container. Raises MaterialError."""
    with file.open("rb") as stream:
        is_container = stream.read(1) == FIRST_BYTE
    return MatrixBtf(file) if is_container else ZippedBtf(file)
