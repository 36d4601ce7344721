"""Import of scene files in any supported format, detected from their content."""

from __future__ import annotations

import codecs
import re
from dataclasses import replace
from pathlib import Path

from relume.assets.environments.environment import Environment
from relume.core.errors import SceneError
from relume.scene.model import Scene
from relume.scene_io.gltf import import_gltf
from relume.scene_io.import_options import ImportOptions
from relume.scene_io.obj_ply import import_obj, import_ply, import_stl, is_stl
from relume.scene_io.placement import place
from relume.scene_io.referenced_files import Companions, Folder, NoFiles
from relume.scene_io.root_layer import is_usd
from relume.scene_io.text_encoding import to_utf8
from relume.scene_io.usd import import_usd
from relume.scene_io.zip_scene import open_zip

MAX_FILE_BYTES = 512 << 20
OBJ_LINE = re.compile(rb"(?:^|\r|\xef\xbb\xbf)[ \t]*(v|vn|vt|f|o|g|usemtl|mtllib)[ \t]", re.MULTILINE)


def import_scene(
    source: str | Path | bytes,
    name: str,
    environment: Environment | None = None,
    companions: Companions | None = None,
    options: ImportOptions | None = None,
) -> Scene:
    """Import .glb, .gltf, .obj, .ply, .stl, .usd, or a .zip with one of them and the files that it needs.

    Args:
        source: a path, whose folder may have further files; or the bytes of a file.
        name: name of the scene, shown to users.
        environment: None for the built-in studio.
        companions: further files, if they are not in the folder or in the same archive.
        options: what the file does not say; None for the defaults.

    Raises:
        SceneError: the file is unusable; the message says why and what to do.
    """
    data = read_file(source)
    if not data:
        raise SceneError("the scene file is empty: 0 bytes; export or download it again")
    if companions is None:
        companions = NoFiles() if isinstance(source, bytes) else Folder(Path(source).parent)
    if data.startswith(b"PK"):
        data, companions = open_zip(data)
    data = to_utf8(data)
    options = options or ImportOptions()
    scene = _read(data, name, environment, companions, options)
    return replace(place(scene, options), ies_files=scene.ies_files)


def _read(
    data: bytes, name: str, environment: Environment | None, companions: Companions, options: ImportOptions
) -> Scene:
    """The scene in meters with +Y up if the file says how and the options leave it to the file, otherwise as it is."""
    recenter = options.recenter
    if is_usd(data):
        return import_usd(data, name, environment, companions, options)
    if data.removeprefix(codecs.BOM_UTF8).startswith(b"ply"):
        return import_ply(data, name, environment, companions, recenter)
    if data.startswith(b"glTF") or data[:64].lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
        return import_gltf(data, name, environment, companions, options)
    if b"\0" not in data[:4_096] and OBJ_LINE.search(data[: 1 << 20]):
        return import_obj(data, name, environment, companions, recenter)
    if is_stl(data):
        return import_stl(data, name, environment, recenter)
    raise SceneError("the scene file is not .glb, .gltf, .obj, .ply, .stl, .usd or .zip; export it as .glb")


def read_file(source: str | Path | bytes) -> bytes:
    """Read a file of limited size. Raises SceneError."""
    if isinstance(source, bytes):
        data = source
    else:
        try:
            if Path(source).stat().st_size > MAX_FILE_BYTES:
                raise SceneError(f"{Path(source).name!r} is larger than {MAX_FILE_BYTES >> 20} MB; simplify the scene")
            data = Path(source).read_bytes()
        except OSError as problem:
            raise SceneError(f"{str(source)!r} cannot be read ({problem.strerror}); check the path") from None
    if len(data) > MAX_FILE_BYTES:
        raise SceneError(f"the scene file has {len(data) >> 20} of at most {MAX_FILE_BYTES >> 20} MB; simplify it")
    return data
