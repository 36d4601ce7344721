"""Import of BTF files: reads, compresses and stores them. An interrupted import resumes."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from relume.assets.btf.bonn_container import FIRST_BYTE
from relume.assets.btf.bonn_zip import ZippedBtf
from relume.assets.btf.btf_store import STORE, BtfRecord, store_btf
from relume.assets.btf.compress import compress
from relume.assets.btf.compressed_view import ViewArrays
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
    """Import a zip of images or a .btf container; equal files are the same BTF.

    Args:
        folder: folder of the asset store. file: file of either kind. name: shown to users.
        bound: allowed relative RMS error. progress: called with the completed fraction. is_canceled: checked regularly.
        partial_folder: folder of partial results; by default in `folder`, named by the file's content.
        images: images of the file, if the caller reads it.
    Raises:
        MaterialError: the file is of neither kind, or the store is full. CancelledError: `is_canceled` is true; partial
            results stay.
    """
    images = images or open_images(file)
    partial_folder = partial_folder or folder / "making" / STORE.content_id(file)
    partial_compression = PartialCompression(partial_folder, {"bound": bound})

    def compress_images() -> LocalPcaBtf:
        try:
            return compress(images, bound, progress, is_canceled, partial_compression)
        except MaterialError:  # a fault of the file: it cannot resume
            shutil.rmtree(partial_folder, ignore_errors=True)
            raise

    record = store_btf(folder, file, name, None, compress_images)
    shutil.rmtree(partial_folder, ignore_errors=True)
    return record


def open_images(file: Path) -> ZippedBtf | MatrixBtf:
    """Open the images of a zip or of a .btf container. Raises MaterialError."""
    with file.open("rb") as stream:
        is_container = stream.read(1) == FIRST_BYTE
    return MatrixBtf(file) if is_container else ZippedBtf(file)
