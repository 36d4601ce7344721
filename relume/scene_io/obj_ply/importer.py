"""Conversion of OBJ, PLY and STL to a scene; one mesh per object and material."""

from __future__ import annotations

import posixpath
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.studio import studio
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported
from relume.math.bounding_box import bounding_box
from relume.scene.collect_lights import LightCollector
from relume.scene.finalize import finalize, no_triangles
from relume.scene.model import F32, Light, Material, Mesh, Scene, Texture, TextureEncoding
from relume.scene.unique_names import unique_name
from relume.scene.vertex_colors import MAX_COLORED, WRAP, draw_color_image, is_uniform
from relume.scene_io.gltf.cameras import framing_camera
from relume.scene_io.import_options import Recenter
from relume.scene_io.obj_ply.material_maker import MaterialMaker, emission_factor, read_companion, textured
from relume.scene_io.obj_ply.mtl import read_library
from relume.scene_io.obj_ply.mtl_dialects import MtlMap, MtlMaterial
from relume.scene_io.obj_ply.obj import Obj, as_rows, read_obj
from relume.scene_io.obj_ply.ply import Ply, read_ply
from relume.scene_io.obj_ply.polygons import CutPolygons, triangulate
from relume.scene_io.obj_ply.stl import read_stl
from relume.scene_io.obj_ply.text import counted
from relume.scene_io.obj_ply.weld import Corners, make_mesh, used_rows
from relume.scene_io.origin import choose_origin, moved_warning
from relume.scene_io.referenced_files import Companions, NoFiles
from relume.scene_io.surfaces.uv_transforms import UvSlot

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
MAX_LIBRARIES = 100
SCAN_ROUGHNESS = 0.5


class _Builder:
    """Collects the meshes and materials of one file."""

    def __init__(self, companions: Companions, warnings: list[ImporterWarning]) -> None:
        self.warnings = warnings
        self.maker = MaterialMaker(companions, warnings)
        self.meshes: list[Mesh] = []
        self.materials: list[Material] = []
        self.emissions: list[F64] = []
        self._mesh_names: dict[str, int] = {}

    def add_material(self, name: str, mtl_material: MtlMaterial | None) -> UvSlot:
        """Append a material; return the UV coordinates of its images."""
        material, slot = self.maker.make(name, mtl_material)
        self.materials.append(material)
        self.emissions.append(emission_factor(material, mtl_material))
        return slot

    def add_colored(self, name: str, colors: Shaped[F32, "triangles 3 3"]) -> Shaped[F32, "triangles 3 2"] | None:
        """Append a material with colors of corners, linear; return UV coordinates if they vary and became an image."""
        opaque = np.concatenate([colors, np.ones((*colors.shape[:2], 1), np.float32)], axis=-1)
        is_varied = not is_uniform(opaque.reshape(-1, 4))
        has_image = is_varied and len(colors) <= MAX_COLORED
        if is_varied and not has_image:
            message = f"Vertex colors were replaced by their average: there are more than {MAX_COLORED:,} triangles."
            self.warnings.append(approximated(message))
        base = np.ones(3) if has_image else colors.mean(axis=(0, 1), dtype=np.float64)
        numbers = {"Kd": [round(float(value), 6) for value in base], "Pr": [SCAN_ROUGHNESS]}
        self.add_material(name, MtlMaterial(numbers=numbers))
        if not has_image:
            return None
        image, uvs, _ = draw_color_image(opaque)
        texture = Texture(np.ascontiguousarray(image[..., :3]), WRAP, TextureEncoding("srgb"))
        self.materials[-1] = textured(self.materials[-1], texture)
        return uvs

    def add_mesh(self, corners: Corners, name: str, label: str = "") -> None:
        """Append a mesh of the newest material, unless it has no triangles with an area."""
        mesh_name = unique_name(name, self._mesh_names)
        index = len(self.materials) - 1
        label = label or f"mesh {quote(mesh_name)}"
        mesh = make_mesh(corners, mesh_name, index, self.materials[index], label, self.warnings)
        self.meshes.extend([] if mesh is None else [mesh])

    def scene(self, name: str, environment: Environment | None, origin: F64) -> Scene:
        """The finished scene. Raises SceneError with all faults if there is nothing to show."""
        if not self.meshes:
            raise SceneError(no_triangles(self.warnings, "the file has no faces with an area"))
        self.maker.warn_gloss()
        collector = LightCollector(self.warnings)
        materials = collector.emissive_light(self.materials, self.emissions, self.meshes)
        lights: Sequence[Light] = collector.lights
        cameras = [framing_camera(self.meshes, "front")]
        offset = (float(origin[0]), float(origin[1]), float(origin[2]))
        light = environment or studio()
        return finalize(name, self.meshes, materials, cameras, light, self.warnings, lights=lights, offset=offset)


def import_obj(
    data: bytes, name: str, environment: Environment | None, companions: Companions, recenter: Recenter = "auto"
) -> Scene:
    """Import a Wavefront .obj file, with the .mtl files and images that it refers to.

    Args:
        data: the file.
        name: name of the scene.
        environment: None for the built-in studio.
        companions: further files.
        recenter: see `ImportOptions`.
    Raises:
        SceneError: it is too large, or has no triangles.
    """
    obj = read_obj(data)
    warnings = obj.warnings()
    library = _library(obj, companions, warnings)
    uvs, normals = as_rows(obj.uvs, 2), as_rows(obj.normals, 3)
    uvs[:, 1] = 1 - uvs[:, 1]
    positions, triangles, origin = _shape(obj, len(uvs), len(normals), recenter, warnings)
    colors = obj.vertex_colors(warnings)
    builder = _Builder(companions, warnings)
    for material_name, objects in _by_material(obj, triangles).items():
        blocks = [triangles.corners[rows] for rows in objects.values()]
        corners = Corners(positions, uvs, normals, np.concatenate(blocks))
        corners = _add_obj_material(builder, material_name, library, corners, colors)
        ends = np.cumsum([len(block) for block in blocks])
        for object_name, block in zip(objects, np.split(corners.triangles, ends[:-1]), strict=True):
            builder.add_mesh(replace(corners, triangles=block), object_name or material_name or "mesh")
    _warn_missing_materials(obj, library, "gray" if colors is None else "colored by its vertices", warnings)
    return builder.scene(name, environment, origin)


def _by_material(obj: Obj, triangles: CutPolygons) -> dict[str, dict[str, I64]]:
    """Indices of the triangles of each object, by material."""
    group = np.array(obj.group, np.int64)[triangles.polygon]
    order = np.argsort(group, kind="stable")
    rows = np.split(order, np.cumsum(np.bincount(group, minlength=len(obj.groups)))[:-1])
    by_material: dict[str, dict[str, I64]] = {}
    for (object_name, material), index in obj.groups.items():
        if len(rows[index]):
            by_material.setdefault(material, {})[object_name] = rows[index]
    return by_material


def _shape(
    obj: Obj, num_uvs: int, num_normals: int, recenter: Recenter, warnings: list[ImporterWarning]
) -> tuple[F64, CutPolygons, F64]:
    """Positions relative to the origin, triangles, and the origin."""
    positions = as_rows(obj.positions, 3)
    triangles, faults = triangulate(obj.polygons(), positions, num_uvs, num_normals, ".obj")
    warnings.extend(faults)
    positions, origin = _recenter(positions, triangles.corners[..., 0], recenter, warnings)
    return positions, triangles, origin


def _add_obj_material(
    builder: _Builder, name: str, library: dict[str, MtlMaterial], corners: Corners, colors: F32 | None
) -> Corners:
    """Add a material of the library, or of the vertex colors; return the corners with its UV coordinates."""
    mtl_material = _find(library, name)
    if mtl_material is None and colors is not None:
        return _with_uvs(corners, builder.add_colored(name, colors[corners.triangles[..., 0]]))
    if colors is not None:
        message = f"Vertex colors of material {quote(name)} were ignored: the material file defines it."
        builder.warnings.append(unsupported(message))
    slot = builder.add_material(name, mtl_material)
    return (
        corners
        if slot == UvSlot()
        else replace(corners, uvs=slot.apply({0: corners.uvs.astype(np.float32)}, len(corners.uvs)).astype(float))
    )


def _find(library: dict[str, MtlMaterial], name: str) -> MtlMaterial | None:
    """A material of the library; a name may end with a comment that has no space after its sign."""
    return library.get(name) or library.get(name.split(" #")[0].strip())


def _warn_missing_materials(
    obj: Obj, library: dict[str, MtlMaterial], look: str, warnings: list[ImporterWarning]
) -> None:
    """One warning for all materials without a library, or one for each that the library lacks; `look` is theirs."""
    names = [material for _, material in obj.groups if material and _find(library, material) is None]
    names = list(dict.fromkeys(names))
    if names and not obj.libraries:
        listed = ", ".join(map(quote, names[:3])) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
        warnings.append(unsupported(f"The file names no material file; each material is {look}: {listed}."))
    elif names:
        warnings.extend(
            unsupported(f"Material {quote(material)} is missing from the .mtl file; it is {look}.")
            for material in names
        )


def import_ply(
    data: bytes,
    name: str,
    environment: Environment | None,
    companions: Companions | None = None,
    recenter: Recenter = "auto",
) -> Scene:
    """Import a Stanford .ply file, text or binary, with the images that it refers to.

    Args:
        data: the file.
        name: name of the scene.
        environment: None for the built-in studio.
        companions: further files; None for none.
        recenter: see `ImportOptions`.
    Raises:
        SceneError: it is damaged, too large, or has no triangles.
    """
    warnings: list[ImporterWarning] = []
    ply = read_ply(data, warnings)
    triangles, faults = triangulate(ply.polygons, ply.positions, len(ply.uvs), len(ply.normals), ".ply")
    warnings.extend(faults)
    positions, origin = _recenter(ply.positions, triangles.corners[..., 0], recenter, warnings)
    builder = _Builder(companions or NoFiles(), warnings)
    corners = Corners(positions, ply.uvs, ply.normals, triangles.corners)
    if ply.textures:
        _add_textured(builder, ply, triangles, corners)
    elif (colors := _corner_colors(ply, triangles)) is not None and len(colors):
        builder.add_mesh(_with_uvs(corners, builder.add_colored("material", colors)), "mesh", "the mesh")
    else:
        builder.add_material("material", None)
        builder.add_mesh(corners, "mesh", "the mesh")
    return builder.scene(name, environment, origin)


def _add_textured(builder: _Builder, ply: Ply, triangles: CutPolygons, corners: Corners) -> None:
    """A material and a mesh for each image of the file."""
    colors = _corner_colors(ply, triangles)
    if colors is not None and colors.size and colors.min() < 0.99:
        builder.warnings.append(unsupported("Colors of vertices or faces were ignored because the file names images."))
    number = ply.texture_index[triangles.polygon] if len(ply.texture_index) else np.zeros(len(triangles.polygon), int)
    outside = (number < 0) | (number >= len(ply.textures))
    if outside.any():
        message = (
            f"{counted(int(outside.sum()), 'triangle')} of the .ply file with an unnamed image: shown with the first."
        )
        builder.warnings.append(unsupported(message))
    number = np.where(outside, 0, number)
    for k, texture in enumerate(ply.textures):
        rows = np.flatnonzero(number == k)
        if len(rows):
            stem = posixpath.splitext(posixpath.basename(texture.replace("\\", "/")))[0]
            maps = {"map_Kd": MtlMap(texture)}
            builder.add_material(stem, MtlMaterial(numbers={"Pr": [SCAN_ROUGHNESS]}, maps=maps))
            builder.add_mesh(replace(corners, triangles=corners.triangles[rows]), stem or "mesh")


def _corner_colors(ply: Ply, triangles: CutPolygons) -> Shaped[F32, "triangles 3 3"] | None:
    """Linear colors of the corners, from vertices or else from faces."""
    if ply.colors is not None:
        return ply.colors[triangles.corners[..., 0]]
    return None if ply.face_colors is None else np.repeat(ply.face_colors[triangles.polygon][:, None], 3, axis=1)


def import_stl(data: bytes, name: str, environment: Environment | None, recenter: Recenter = "auto") -> Scene:
    """Import an .stl file, binary or text.

    Args:
        data: the file.
        name: name of the scene.
        environment: None for the built-in studio.
        recenter: see `ImportOptions`.
    Raises:
        SceneError: it is too large, or has no triangles.
    """
    warnings: list[ImporterWarning] = []
    stl = read_stl(data, warnings)
    positions, origin = _recenter(stl.positions, stl.triangles, recenter, warnings)
    indices = np.stack([stl.triangles, *np.full((2, *stl.triangles.shape), -1)], axis=-1)
    corners = Corners(positions, np.zeros((0, 2)), np.zeros((0, 3)), indices)
    builder = _Builder(NoFiles(), warnings)
    if stl.colors is not None and len(stl.colors):
        corners = _with_uvs(corners, builder.add_colored("material", np.repeat(stl.colors[:, None], 3, axis=1)))
    else:
        builder.add_material("material", None)
    blocks = np.split(corners.triangles, np.cumsum([count for _, count in stl.solids])[:-1])
    for (solid_name, _), block in zip(stl.solids, blocks, strict=True):
        if len(block):
            builder.add_mesh(replace(corners, triangles=block), solid_name or "mesh")
    return builder.scene(name, environment, origin)


def _recenter(positions: F64, vertices: I64, recenter: Recenter, warnings: list[ImporterWarning]) -> tuple[F64, F64]:
    """Positions relative to the new origin, and the origin: in double precision, before positions are rounded."""
    if vertices.size == 0:
        return positions, np.zeros(3)
    used = used_rows(positions, vertices)
    origin = choose_origin(*bounding_box(used), recenter)
    warnings.extend(moved_warning(origin))
    return (positions - origin if origin.any() else positions), origin


def _with_uvs(corners: Corners, uvs: Shaped[F32, "triangles 3 2"] | None) -> Corners:
    """Corners with new UV coordinates for each; unchanged without any."""
    if uvs is None:
        return corners
    indices = np.arange(3 * len(uvs)).reshape(-1, 3)
    triangles = np.stack([corners.triangles[..., 0], indices, corners.triangles[..., 2]], axis=-1)
    return replace(corners, uvs=uvs.reshape(-1, 2).astype(np.float64), triangles=triangles)


def _library(obj: Obj, companions: Companions, warnings: list[ImporterWarning]) -> dict[str, MtlMaterial]:
    """All materials of all libraries; the first of each name wins."""
    if len(obj.libraries) > MAX_LIBRARIES:
        raise SceneError(f"the .obj file refers to more than {MAX_LIBRARIES} material files; merge them")
    library: dict[str, MtlMaterial] = {}
    for line in dict.fromkeys(obj.libraries):
        for name, data in _read_libraries(line, companions, warnings):
            library = read_library(data, posixpath.dirname(name.replace("\\", "/")), warnings) | library
    return library


def _read_library(companions: Companions, name: str, warnings: list[ImporterWarning]) -> bytes | None:
    """A material file; one that is missing may have kept its name with the suffix .mtl."""
    missing: list[ImporterWarning] = []
    data = read_companion(companions, "", name, "the material file", missing, kind="material file")
    renamed = posixpath.splitext(name)[0] + ".mtl"
    if data is None and renamed != name:
        data = read_companion(companions, "", renamed, "the material file", [], kind="material file")
        if data is not None:
            missing = [approximated(f"The material file {quote(name)} is missing; {quote(renamed)} beside it is used.")]
    warnings.extend(missing)
    return data


def _read_libraries(line: str, companions: Companions, warnings: list[ImporterWarning]) -> list[tuple[str, bytes]]:
    """The files of one `mtllib`: the whole line is a name that may contain spaces, otherwise each word is one.

    If none is there, the missing one is the whole line, unless every word ends like a file.
    """
    whole = line.strip('"').replace("\\ ", " ")
    words = [word.strip('"').replace("\0", " ") for word in line.replace("\\ ", "\0").split()]
    attempts: list[list[ImporterWarning]] = []
    for names in ([whole], words)[: 1 + (len(words) > 1)]:
        attempts.append([])
        read = [(name, _read_library(companions, name, attempts[-1])) for name in names]
        if any(data is not None for _, data in read):
            break
    else:
        attempts = attempts[: None if all(posixpath.splitext(word)[1] for word in words) else 1]
    warnings.extend(attempts[-1])
    return [(name, data) for name, data in read if data is not None]
