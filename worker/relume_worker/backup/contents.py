"""Files of a data directory that belong in a backup: without the database, unfinished jobs and derived files."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

from relume.core.errors import StoreError
from relume.core.filesystem import UNFINISHED
from relume.store.publish import manifest_digests
from relume.store.schema import MANIFEST_NAME

EXCLUDED_PATTERNS = (
    "relume.db*",
    "restoring.json",
    "upload-*",
    "thumbnails",
    "bakes/staging",
    "bakes/locks",
    "scenes/locks",
    "bakes/*.zarr/derived",
    "bakes/*.zarr/edited",
    f"*{UNFINISHED}",
)
"""Patterns of excluded paths, with everything below them."""


@dataclass(frozen=True)
class FileEntry:
    """A file of a backup.

    Attributes:
        path: path below the data directory, with "/".
        num_bytes, mtime_ns: size and modification time, used to detect changes.
        sha256: expected digest; None if it is unknown.
    """

    path: str
    num_bytes: int
    mtime_ns: int
    sha256: str | None


def walk_files(data_dir: Path) -> Iterator[FileEntry]:
    """Yield the files in sorted order; for a published store, the files in its manifest, which never change."""
    digests: dict[str, str] = {}
    for folder, folders, names in os.walk(data_dir):
        relative_folder = Path(folder).relative_to(data_dir).as_posix()
        folders[:] = sorted(name for name in folders if _is_included(_join(relative_folder, name)))
        if fnmatch(relative_folder, "bakes/*.zarr"):
            digests = _digests(Path(folder), relative_folder)
            if not digests:
                folders.clear()  # being published or deleted
                continue
        is_store = fnmatch(relative_folder, "bakes/*.zarr*")
        for path in (_join(relative_folder, name) for name in sorted(names)):
            if not _is_included(path) or (is_store and path not in digests and not path.endswith(f"/{MANIFEST_NAME}")):
                continue
            try:
                stat = (data_dir / path).stat()
            except FileNotFoundError:  # deleted in the meantime
                continue
            yield FileEntry(path, stat.st_size, stat.st_mtime_ns, digests.get(path) if is_store else None)


def _digests(store: Path, relative_folder: str) -> dict[str, str]:
    try:
        return {f"{relative_folder}/{name}": digest for name, digest in manifest_digests(store).items()}
    except StoreError:
        return {}


def _is_included(path: str) -> bool:
    return not any(fnmatch(path, pattern) for pattern in EXCLUDED_PATTERNS)


def _join(folder: str, name: str) -> str:
    return name if folder == "." else f"{folder}/{name}"
