"""Conversion of OBJ and PLY to a scene with +Y up and meters; one mesh per object and material."""

from __future__ import annotations

import posixpath
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.assets.environments.environment import Environment
from relume.assets.environments.studio import studio
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored, quote, unsupported
from relume.scene.collect_lights import F64, LightCollector
from relume.scene.finalize import finalize
from relume.scene.model import F32, Light, Material, Mesh, Scene, Texture, TextureEncoding
from relume.scene.unique_names import unique_name
from relume.scene.vertex_colors import MAX_COLORED, WRAP, draw_color_image, is_uniform
from relume.scene_io.gltf.cameras import framing_camera
from relume.scene_io.obj_ply.mtl import MaterialMaker, read_library
from relume.scene_io.obj_ply.mtl_dialects import MtlMaterial
from relume.scene_io.obj_ply.obj import Obj, read_obj
from relume.scene_io.obj_ply.ply import read_ply
from relume.scene_io.obj_ply.weld import Corners, make_mesh
from relume.scene_io.referenced_files import Companions, NoFiles

MAX_LIBRARIES = 100


def import_obj(data: bytes, name: str, environment: Environment | None, companions: Companions) -> Scene:
    """Import a Wavefront .obj file, with the .mtl files and images that it refers to.

    Args:
        data: the file.
        name: name of the scene.
        environment: None for the built-in studio.
        companions: further files.
    Raises:
        SceneError: it is damaged, too large, or has no triangles.
    """
    warnings: list[ImporterWarning] = []
    obj = read_obj(data)
    library = _library(obj, companions, warnings)
    kinds = {"p": "points", "l": "lines"}
    warnings.extend(
        ignored(f"The file's {kinds.get(keyword, f'“{keyword}” elements')} aren't supported; only faces are shown.")
        for keyword in sorted(obj.ignored_keywords)
    )
    maker = MaterialMaker(companions, warnings)
    material_indices: dict[str, int] = {}
    materials: list[Material] = []
    emissions: list[F64] = []
    meshes: list[Mesh] = []
    used_names: dict[str, int] = {}
    groups = obj.corners()
    if (colors := obj.vertex_colors()) is not None:
        if len(groups) == 1 and not obj.libraries:
            return _scan(next(iter(groups.values())), colors, name, environment, warnings)
        warnings.append(approximated("Vertex colors were ignored because the .obj file has materials or objects."))
    for (object_name, material), corners in groups.items():
        if material not in material_indices:
            material_indices[material] = len(materials)
            if material and obj.libraries and material not in library:
                warnings.append(unsupported(f"Material {quote(material)} is missing from the .mtl file; it is gray."))
            materials.append(maker.make(material, library.get(material)))
            emissions.append(maker.emission(materials[-1], library.get(material)))
        mesh_name = unique_name(object_name or material or "mesh", used_names)
        material_index = material_indices[material]
        label = f"mesh {quote(mesh_name)}"
        mesh = make_mesh(corners, mesh_name, material_index, materials[material_index], label, warnings)
        meshes.extend([] if mesh is None else [mesh])
    maker.warn_gloss()
    collector = LightCollector(warnings)
    lit_materials = collector.emissive_light(materials, emissions, meshes)
    return _scene(name, meshes, lit_materials, environment, warnings, collector.lights)


def import_ply(data: bytes, name: str, environment: Environment | None) -> Scene:
    """Import a Stanford .ply file, text or binary.

    Args:
        data: the file.
        name: name of the scene.
        environment: None for the built-in studio.
    Raises:
        SceneError: it is damaged, too large, or has no triangles.
    """
    return _scan(*read_ply(data), name, environment, [])


def _scan(
    corners: Corners, colors: F32 | None, name: str, environment: Environment | None, warnings: list[ImporterWarning]
) -> Scene:
    """A scene with one mesh and one material, with vertex colors."""
    corners, material = _apply_vertex_colors(corners, colors, MaterialMaker(NoFiles(), warnings), warnings)
    mesh = make_mesh(corners, "mesh", 0, material, "the mesh", warnings)
    return _scene(name, [] if mesh is None else [mesh], [material], environment, warnings)


def _apply_vertex_colors(
    corners: Corners, colors: F32 | None, maker: MaterialMaker, warnings: list[ImporterWarning]
) -> tuple[Corners, Material]:
    """A material with vertex colors (num_positions, 3), drawn into an image if they vary; corners with UVs for it."""
    if colors is None:
        return corners, maker.make("material", None)
    opaque = np.concatenate([colors, np.ones((len(colors), 1), np.float32)], axis=1)
    vertex_indices = corners.triangles[..., 0]
    has_color_image = (
        not is_uniform(opaque) and 0 < len(vertex_indices) <= MAX_COLORED and vertex_indices.max() < len(colors)
    )
    if not has_color_image and not is_uniform(opaque):
        message = f"Vertex colors were replaced by their average: there are more than {MAX_COLORED:,} triangles."
        warnings.append(approximated(message))
    base = np.ones(3) if has_color_image else colors.mean(axis=0, dtype=np.float64)
    mtl_material = MtlMaterial()
    mtl_material.numbers = {"Kd": [round(float(value), 6) for value in base], "Pr": [0.5]}
    material = maker.make("material", mtl_material)
    if not has_color_image or vertex_indices.min() < 0:
        return corners, material
    image, uvs, _ = draw_color_image(opaque[vertex_indices])
    uv_indices = np.arange(3 * len(vertex_indices)).reshape(-1, 3)
    textured = replace(
        corners,
        uvs=uvs.reshape(-1, 2).astype(np.float64),
        triangles=np.stack([vertex_indices, uv_indices, corners.triangles[..., 2]], axis=-1),
    )
    texture = Texture(np.ascontiguousarray(image[..., :3]), WRAP, TextureEncoding("srgb"))
    terms = ({**material.terms[0], "texture": "diffuse"}, *material.terms[1:])
    return textured, replace(material, terms=terms, textures={"diffuse": texture})


def _library(obj: Obj, companions: Companions, warnings: list[ImporterWarning]) -> dict[str, MtlMaterial]:
    """All materials of all libraries; the first of each name wins."""
    if len(obj.libraries) > MAX_LIBRARIES:
        raise SceneError(f"the .obj file refers to more than {MAX_LIBRARIES} material files; merge them")
    library: dict[str, MtlMaterial] = {}
    for name in dict.fromkeys(obj.libraries):
        data = companions.read(name, "the material file")
        if data is None:
            printable = name[:60].encode("ascii", "replace").decode()
            message = f"Missing material file “{printable}”: import it together with the scene."
            warnings.append(unsupported(message))
        else:
            library = read_library(data, posixpath.dirname(name.replace("\\", "/"))) | library
    return library


def _scene(
    name: str,
    meshes: list[Mesh],
    materials: Sequence[Material],
    environment: Environment | None,
    warnings: list[ImporterWarning],
    lights: Sequence[Light] = (),
) -> Scene:
    if not meshes:
        raise SceneError("the scene has no triangles with an area; export at least one mesh made of triangles")
    cameras = [framing_camera(meshes, "front")]
    return finalize(name, meshes, materials, cameras, environment or studio(), warnings, lights=lights)
