"""A scene in a .zip file: one scene file and its companions, with limits that are checked before decompression."""

from __future__ import annotations

import io
import posixpath
import zipfile

from relume.archives.bounded import LongDirectoryError, open_bounded
from relume.core.errors import SceneError
from relume.scene_io.referenced_files import MAX_BYTES, Archive, entry_name, read_entry
from relume.scene_io.root_layer import find_roots

MAX_ENTRIES = 1_000
MAX_DIRECTORY_BYTES = 1 << 20
LAYER_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
SCENE_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")
_USDZ_ALIGNMENT = 64  # bytes; of the content of each entry of a .usdz file
TOO_MANY_ENTRIES = f"the .zip file has more than {MAX_ENTRIES:,} entries; pack only what the scene needs"


def open_zip(
    data: bytes, suffixes: tuple[str, ...] = SCENE_SUFFIXES, kind: str = "scene", *, opens_packages: bool = True
) -> tuple[bytes, Archive]:
    """Open the scene file in an archive, and its companions.

    Args:
        data: the archive. suffixes: of the file that names the others. kind: names that file in messages.
        opens_packages: a scene file that is a .usdz package, which is an archive too, is opened in its turn.
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
    scene = _find_document(data, entries, archive, suffixes, kind)
    document = read_entry(archive, scene)
    if opens_packages and scene.filename.lower().endswith(".usdz"):
        return open_zip(document, opens_packages=False)
    return document, Archive(archive, posixpath.dirname(entry_name(scene).replace("\\", "/")))


def _find_document(
    data: bytes, entries: list[zipfile.ZipInfo], archive: zipfile.ZipFile, suffixes: tuple[str, ...], kind: str
) -> zipfile.ZipInfo:
    """The only file with such a suffix; of USD layers the first of a .usdz file, else the one that no other names."""
    found = [entry for entry in entries if entry.filename.lower().endswith(suffixes)]
    layers = [entry for entry in entries if entry.filename.lower().endswith(LAYER_SUFFIXES)]
    if layers and not found and suffixes == SCENE_SUFFIXES:
        if _is_usdz(data, entries[0]):
            return entries[0]
        found = [_find_root_layer(layers, archive)]
    if len(found) != 1:
        named = (*suffixes, ".usd") if suffixes == SCENE_SUFFIXES else suffixes
        names = " or ".join(", ".join(named).rsplit(", ", 1))
        raise SceneError(f"the .zip file contains {len(found)} {kind} files; pack one of {names}")
    return found[0]


def _find_root_layer(layers: list[zipfile.ZipInfo], archive: zipfile.ZipFile) -> zipfile.ZipInfo:
    """The layer that no other layer names; of several, the only one in the uppermost folder."""
    if len(layers) == 1:
        return layers[0]
    roots = find_roots({entry_name(entry): read_entry(archive, entry) for entry in layers})
    depth = min((name.count("/") for name in roots), default=0)
    upper = [name for name in roots if name.count("/") == depth]
    if len(upper) != 1:
        listed = ", ".join(sorted(upper)[:5])
        message = f"the .zip file contains {len(upper)} USD scenes side by side ({listed}); leave one of them"
        raise SceneError(f"{message}, or pack it as .usdz")
    return next(entry for entry in layers if entry_name(entry) == upper[0])


def _is_usdz(data: bytes, first: zipfile.ZipInfo) -> bool:
    """True if the first entry of an archive is a layer at the place that .usdz files require."""
    header = data[first.header_offset : first.header_offset + 30]
    start = first.header_offset + 30 + int.from_bytes(header[26:28], "little") + int.from_bytes(header[28:30], "little")
    is_layer = first.filename.lower().endswith(LAYER_SUFFIXES)
    return is_layer and first.compress_type == zipfile.ZIP_STORED and start % _USDZ_ALIGNMENT == 0


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
