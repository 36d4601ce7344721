"""A scene as a folder: scene.json (text and numbers) and arrays.npz, identified by the hash of the content."""

from __future__ import annotations

import hashlib
import json
import math
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.core.errors import NotFoundError, SceneError
from relume.core.filesystem import atomic_write
from relume.core.import_warnings import ImporterWarning, warning_of
from relume.scene.lens import read_lens
from relume.scene.light_members import LightMembers
from relume.scene.model import Camera, Glass, Light, Material, Mesh, Opacity, Scene, Texture, TextureEncoding
from relume.scene.validate import check_scene

FORMAT_VERSION = 1
MAX_JSON_BYTES = 64 << 20
MAX_ARRAY_BYTES = 16 << 30
MESH_ARRAYS = ("positions", "normals", "tangents", "uvs", "faces")
REMEDY = "import the scene again"
NOT_CONTENT = ("id", "warnings", "aspects", "import_options")  # of a document: scenes that differ in them are the same
_STORED = (np.dtype("<f4"), np.dtype("<u4"), np.dtype("|u1"))

Arrays = dict[str, NDArray[Any]]


def make_scene(
    name: str,
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    cameras: Sequence[Camera],
    environment: Environment,
    warnings: Sequence[ImporterWarning] = (),
    variants: Mapping[str, dict[str, Any]] | None = None,
    lights: Sequence[Light] = (),
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Scene:
    """Validate the arguments and make a scene with its id.

    Args:
        name: shown to users.
        meshes, materials, cameras: at least one of each; a mesh's `material` is an index into `materials`.
        environment: the distant light.
        warnings: warnings of the importer, one sentence each.
        variants: partial looks by name.
        lights: local lights with unique names.
        offset: what was subtracted from the file's positions, meters.
    Raises:
        SceneError: the arguments are not a valid scene (see `relume.scene.validate`).
    """
    check_scene(meshes, materials, cameras, environment, lights)
    contents = (tuple(meshes), tuple(materials), tuple(cameras), environment, tuple(warnings), dict(variants or {}))
    scene = Scene("", name, *contents, tuple(lights), offset)
    document, arrays = _to_document(scene)
    return replace(scene, id=scene_id(document, arrays))


def scene_id(document: dict[str, Any], arrays: Arrays) -> str:
    """First 16 hexadecimal digits of `scene_digest`."""
    return scene_digest(document, arrays)[:16]


def scene_digest(document: dict[str, Any], arrays: Arrays) -> str:
    """SHA-256 of all arrays and of the document without `NOT_CONTENT`, in hexadecimal digits."""
    digest = hashlib.sha256()
    content = {key: value for key, value in document.items() if key not in NOT_CONTENT}
    digest.update(json.dumps(content, sort_keys=True, allow_nan=False).encode())
    for key in sorted(arrays):
        array = np.ascontiguousarray(arrays[key])
        digest.update(f"{key} {array.dtype.str} {array.shape}".encode())
        digest.update(array.data)
    return digest.hexdigest()


def save_scene(scene: Scene, folder: str | Path) -> None:
    """Write a scene into `folder`, which is created if missing; readers see either the old or the new files.

    Raises:
        SceneError: the folder has a scene with the same id and different content.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    document, arrays = _to_document(scene)
    document |= {"id": scene.id, "sha256": scene_digest(document, arrays)}
    if _digest_in(folder, scene.id) not in (None, document["sha256"]):  # a deliberate collision of 64-bit ids
        raise SceneError(f"another scene with the id {scene.id} exists; delete it first if you don't need it")
    with atomic_write(folder / "arrays.npz") as unfinished:
        np.savez(unfinished, allow_pickle=False, **arrays)
    with atomic_write(folder / "scene.json") as unfinished:
        unfinished.write_text(json.dumps(document, indent=1, allow_nan=False), encoding="utf-8")


def _digest_in(folder: Path, scene_id: str) -> str | None:
    """SHA-256 of the scene with that id in a folder; None if it is missing, unreadable, or saved without one."""
    try:
        document = _read_document(folder / "scene.json")
        return document.get("sha256") if document.get("id") == scene_id else None
    except (OSError, ValueError, RecursionError, AttributeError):
        return None


def load_scene(folder: str | Path) -> Scene:
    """Read a scene that `save_scene` wrote.

    Raises:
        SceneError: a file is missing, damaged, too large, or its content does not match its id.
    """
    folder = Path(folder)
    try:
        document = _read_document(folder / "scene.json")
        arrays = _read_arrays(folder / "arrays.npz")
        scene = _from_document(document, arrays)
    except FileNotFoundError:
        raise SceneError(f"there is no scene in {folder.name!r}; {REMEDY}") from None
    except SceneError:
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, zipfile.BadZipFile) as problem:
        detail = str(problem).partition("\n")[0] or type(problem).__name__
        raise SceneError(f"the scene in {folder.name!r} is damaged ({detail}); {REMEDY}") from None
    check_scene(scene.meshes, scene.materials, scene.cameras, scene.environment, scene.lights)
    if scene_id(*_to_document(scene)) != scene.id:
        raise SceneError(f"the scene in {folder.name!r} was modified after it was saved; {REMEDY}")
    return scene


def load_cameras(folder: str | Path) -> list[Camera]:
    """Read only the cameras of a saved scene. Raises SceneError if they cannot be read."""
    try:
        return _cameras(_read_document(Path(folder) / "scene.json"))
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as problem:
        raise SceneError(f"the cameras of the scene in {Path(folder).name!r} cannot be read; {REMEDY}") from problem


def load_material(folder: str | Path, name: str) -> Material:
    """Read only one material of a saved scene, with its arrays.

    Raises:
        SceneError: it cannot be read. NotFoundError: the scene has no such material.
    """
    folder = Path(folder)
    try:
        for index, document in enumerate(_read_document(folder / "scene.json")["materials"]):
            if document["name"] == name:
                arrays = _read_arrays(folder / "arrays.npz", f"material{index}_")
                return _assemble_material(index, document, arrays)
    except (OSError, ValueError, KeyError, TypeError, RecursionError, zipfile.BadZipFile) as problem:
        raise SceneError(f"the materials of the scene in {folder.name!r} cannot be read; {REMEDY}") from problem
    raise NotFoundError(f"the scene has no material {name[:80]!r}; give one of its materials")


def _textures(material: Material) -> Iterator[tuple[str, Texture]]:
    yield from sorted(material.textures.items())
    if material.normal_map is not None:
        yield "normal_map", material.normal_map


def _to_document(scene: Scene) -> tuple[dict[str, Any], Arrays]:
    """Convert a scene to a JSON document and named arrays, without loss."""
    arrays: Arrays = {"environment": scene.environment.radiance}
    for i, mesh in enumerate(scene.meshes):
        arrays |= {f"mesh{i}_{key}": getattr(mesh, key) for key in MESH_ARRAYS}
    for i, material in enumerate(scene.materials):
        arrays |= {f"material{i}_{channel}": texture.pixels for channel, texture in _textures(material)}
        if material.opacity is not None:
            arrays[f"material{i}_opacity"] = material.opacity.alpha
    for i, light in enumerate(scene.lights):
        if light.members is not None:
            arrays[f"light{i}_members"] = light.members.rows()
    document = {
        "format": FORMAT_VERSION,
        "name": scene.name,
        "meshes": [{"name": mesh.name, "material": mesh.material} for mesh in scene.meshes],
        "materials": [
            {
                "name": material.name,
                "terms": list(material.terms),
                "textures": {channel: list(texture.wrap) for channel, texture in _textures(material)},
                "double_sided": material.double_sided,
                # omitted if empty: the ids of older scenes stay valid
                **_encoding_documents(material),
                **({"shadow_catcher": True} if material.shadow_catcher else {}),
                **({"opacity": _opacity_document(material.opacity)} if material.opacity else {}),
                **({"glass": asdict(material.glass)} if material.glass else {}),
            }
            for material in scene.materials
        ],
        "cameras": [_camera_document(camera) for camera in scene.cameras],
        "environment": {"name": scene.environment.name},
        "warnings": [warning.document() for warning in scene.warnings],
    }
    if any(camera.aspect is not None for camera in scene.cameras):
        document["aspects"] = [camera.aspect for camera in scene.cameras]
    if scene.variants:
        document["variants"] = scene.variants
    if scene.lights:
        document["lights"] = [
            {"name": light.name, "fields": light.fields, **({"group": light.group} if light.group else {})}
            for light in scene.lights
        ]
    if any(scene.offset):
        document["offset"] = list(scene.offset)
    if scene.import_options:
        document["import_options"] = scene.import_options
    return document, arrays


def _encoding_documents(material: Material) -> dict[str, Any]:
    encodings = {channel: asdict(texture.encoding) for channel, texture in _textures(material) if texture.encoding}
    return {"codings": encodings} if encodings else {}


def _opacity_document(opacity: Opacity) -> dict[str, Any]:
    return {"wrap": list(opacity.wrap), "cutoff": opacity.cutoff}


def _from_document(document: dict[str, Any], arrays: Arrays) -> Scene:
    """The inverse of `_to_document`; raises built-in exceptions for missing or invalid values."""
    meshes = [
        Mesh(name=str(m["name"]), material=int(m["material"]), **{k: arrays[f"mesh{i}_{k}"] for k in MESH_ARRAYS})
        for i, m in enumerate(document["meshes"])
    ]
    cameras = _cameras(document)
    return Scene(
        str(document["id"]),
        str(document["name"]),
        tuple(meshes),
        tuple(_assemble_material(i, m, arrays) for i, m in enumerate(document["materials"])),
        tuple(cameras),
        Environment(str(document["environment"]["name"]), arrays["environment"]),
        tuple(warning_of(warning) for warning in document["warnings"]),
        {str(name): dict(look) for name, look in document.get("variants", {}).items()},
        tuple(_assemble_light(i, light, arrays) for i, light in enumerate(document.get("lights", ()))),
        _offset(document),
        {str(key): str(value) for key, value in document.get("import_options", {}).items()},
    )


def _assemble_light(i: int, document: dict[str, Any], arrays: Arrays) -> Light:
    rows = arrays.get(f"light{i}_members")
    members = None if rows is None else LightMembers.from_rows(rows)
    return Light(str(document["name"]), dict(document["fields"]), str(document.get("group", "")), members)


def _offset(document: dict[str, Any]) -> tuple[float, float, float]:
    x, y, z = map(float, document.get("offset", (0, 0, 0)))
    return x, y, z


def _assemble_material(i: int, document: dict[str, Any], arrays: Arrays) -> Material:
    textures = {
        channel: _assemble_texture(arrays[f"material{i}_{channel}"], wrap, document.get("codings", {}).get(channel))
        for channel, wrap in document["textures"].items()
    }
    normal_map = textures.pop("normal_map", None)
    terms = tuple(dict(term) for term in document["terms"])
    double_sided, shadow_catcher = bool(document["double_sided"]), bool(document.get("shadow_catcher", False))
    opacity = _assemble_opacity(document["opacity"], arrays[f"material{i}_opacity"]) if "opacity" in document else None
    glass = _assemble_glass(document["glass"]) if "glass" in document else None
    return Material(str(document["name"]), terms, textures, normal_map, double_sided, shadow_catcher, opacity, glass)


def _assemble_glass(document: dict[str, Any]) -> Glass:
    (red, green, blue), (r, g, b) = document["tint"], document["absorbed"]
    tint, absorbed = (float(red), float(green), float(blue)), (float(r), float(g), float(b))
    sizes = float(document["ior"]), float(document["thickness"])
    return Glass(tint, *sizes, absorbed, float(document.get("roughness", 0.0)))


def _assemble_texture(pixels: NDArray[Any], wrap: list[Any], encoding: dict[str, Any] | None) -> Texture:
    channels = 1 if encoding is not None and encoding["kind"] == "share" else 3
    is_image = pixels.ndim == 3 and pixels.shape[2] == channels and pixels.size > 0
    if not is_image or pixels.dtype != (np.float32 if encoding is None else np.uint8):
        raise SceneError(f"a texture of the scene has the wrong shape or type; {REMEDY}")
    wrap_u, wrap_v = map(str, wrap)
    if encoding is None:
        return Texture(pixels, (wrap_u, wrap_v))
    red, green, blue = map(float, encoding["scale"])
    if encoding["kind"] not in ("srgb", "normal", "share"):
        raise SceneError(f"a texture of the scene has an unknown encoding; {REMEDY}")
    return Texture(
        pixels, (wrap_u, wrap_v), TextureEncoding(str(encoding["kind"]), (red, green, blue), float(encoding["turn"]))
    )


def _assemble_opacity(document: dict[str, Any], alpha: NDArray[Any]) -> Opacity:
    wrap_u, wrap_v = document["wrap"]
    cutoff = document["cutoff"]
    return Opacity(alpha, (str(wrap_u), str(wrap_v)), None if cutoff is None else float(cutoff))


def _camera_document(camera: Camera) -> dict[str, Any]:
    lens = {"lens": camera.lens.document()} if camera.lens else {}  # omitted if empty, as above
    return {"name": camera.name, "to_world": camera.to_world.tolist(), "yfov": camera.yfov} | lens


def _cameras(document: dict[str, Any]) -> list[Camera]:
    camera_documents = document["cameras"]
    aspects = document.get("aspects") or [None] * len(camera_documents)
    return [
        Camera(
            str(c["name"]),
            np.array(c["to_world"], np.float64),
            float(c["yfov"]),
            None if a is None else float(a),
            lens=read_lens(c["lens"]) if "lens" in c else None,
        )
        for c, a in zip(camera_documents, aspects, strict=True)
    ]


def _read_document(path: Path) -> dict[str, Any]:
    if path.stat().st_size > MAX_JSON_BYTES:
        raise SceneError(f"{path.name} is larger than {MAX_JSON_BYTES >> 20} MB; {REMEDY}")
    document = json.loads(path.read_bytes())
    if not isinstance(document, dict) or document.get("format") != FORMAT_VERSION:
        raise SceneError(f"{path.name} is not a scene that this relume reads; {REMEDY}")
    return document


def _read_arrays(path: Path, prefix: str = "") -> Arrays:
    """Read the arrays whose names begin with `prefix`. Members are uncompressed, so none exceeds the file's size."""
    size_bytes = path.stat().st_size
    if size_bytes > MAX_ARRAY_BYTES:
        raise SceneError(f"{path.name} is larger than {MAX_ARRAY_BYTES >> 30} GB; {REMEDY}")
    arrays: Arrays = {}
    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            if member.compress_type != zipfile.ZIP_STORED or member.file_size > size_bytes:
                raise SceneError(f"{path.name} was not written by relume; {REMEDY}")
            if not member.filename.startswith(prefix):
                continue
            with archive.open(member) as file:
                arrays[member.filename.removesuffix(".npy")] = _read_array(cast(BinaryIO, file), member.file_size)
    return arrays


def _read_array(file: BinaryIO, size_bytes: int) -> NDArray[Any]:
    """Read one .npy member; its header is checked against its length before memory is allocated."""
    if npy_format.read_magic(file) != (1, 0):
        raise SceneError(f"arrays.npz was not written by relume; {REMEDY}")
    shape, fortran_order, dtype = npy_format.read_array_header_1_0(file)
    needed_bytes = math.prod(shape) * dtype.itemsize
    if fortran_order or dtype not in _STORED or not 0 <= needed_bytes <= size_bytes:
        raise SceneError(f"arrays.npz contains an array that relume does not write; {REMEDY}")
    data = file.read(needed_bytes)
    return np.frombuffer(bytearray(data), dtype).reshape(shape)
