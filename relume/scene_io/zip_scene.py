"""A scene in a .zip file: one scene file and its companions, with limits that are checked before decompression."""

from __future__ import annotations

import io
import posixpath
import zipfile

from relume.archives.bounded import LongDirectoryError, open_bounded
from relume.core.errors import SceneError
from relume.scene_io.referenced_files import MAX_BYTES, Archive, read_entry

MAX_ENTRIES = 1_000
MAX_DIRECTORY_BYTES = 1 << 20
SCENE_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")
TOO_MANY_ENTRIES = f"the .zip file has more than {MAX_ENTRIES:,} entries; pack only what the scene needs"


def open_zip(data: bytes, suffixes: tuple[str, ...] = SCENE_SUFFIXES, kind: str = "scene") -> tuple[bytes, Archive]:
    """Open the scene file in an archive, and its companions.

    Args:
        data: the archive. suffixes: of the file that names the others. kind: names that file in messages.
    Raises:
        SceneError: the archive is damaged, encrypted, too large, or does not contain exactly one scene file.
    """
    if b"PK\5\6" not in data:
        raise SceneError("the .zip file is truncated; download or pack it again")
    try:
        archive = open_bounded(io.BytesIO(data), MAX_DIRECTORY_BYTES)
    except LongDirectoryError:
        raise SceneError(TOO_MANY_ENTRIES) from None
    except Exception:  # zipfile raises many kinds for damaged data
        raise SceneError("the .zip file is damaged; pack it again") from None
    entries = [entry for entry in archive.infolist() if not entry.is_dir() and not _is_litter(entry.filename)]
    _check_entries(entries)
    scenes = [entry for entry in entries if entry.filename.lower().endswith(suffixes)]
    if len(scenes) != 1:
        names = " or ".join(", ".join(suffixes).rsplit(", ", 1))
        raise SceneError(f"the .zip file contains {len(scenes)} {kind} files; pack one of {names}")
    folder = posixpath.dirname(scenes[0].filename.replace("\\", "/"))
    return read_entry(archive, scenes[0]), Archive(archive, folder)


def _check_entries(entries: list[zipfile.ZipInfo]) -> None:
    if len(entries) > MAX_ENTRIES:
        raise SceneError(TOO_MANY_ENTRIES)
    if sum(entry.file_size for entry in entries) > MAX_BYTES:
        raise SceneError(f"the .zip file unpacks to more than {MAX_BYTES >> 20} MB; scale it down")
    for entry in entries:
        if entry.flag_bits & 1:
            raise SceneError("the .zip file is encrypted; pack it without a password")
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise SceneError("the .zip file has an unsupported compression; pack it with deflate")


def _is_litter(name: str) -> bool:
    """True for files that operating systems add to archives."""
    return name.startswith("__MACOSX/") or posixpath.basename(name).startswith(".")
