"""OBJ and PLY to Scene: +Y up and metres, as everywhere; one mesh per object and material."""

from __future__ import annotations

import posixpath
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.environments.model import Environment
from relume.environments.studio import studio
from relume.errors import SceneError
from relume.remarks import Remark, simplified, unused, wrong
from relume.scene.companions import Alone, Companions
from relume.scene.finish import finished_scene
from relume.scene.gltf.cameras import framing_camera
from relume.scene.gltf.names import unique_name
from relume.scene.lights import F64, LightCollector
from relume.scene.mesh_files.corners import Corners, make_mesh
from relume.scene.mesh_files.mtl import MaterialMaker, read_library
from relume.scene.mesh_files.mtl_dialects import Described
from relume.scene.mesh_files.obj import Obj, read_obj
from relume.scene.mesh_files.ply import read_ply
from relume.scene.model import F32, Coding, Light, Material, Mesh, Scene, Texture
from relume.scene.vertex_colors import MAX_COLORED, WRAP, are_alike, colors_as_image

MAX_LIBRARIES = 100


def import_obj(data: bytes, name: str, environment: Environment | None, companions: Companions) -> Scene:
    """Reads a Wavefront .obj file, and the .mtl files and images that it names.

    Args:
        data: the file.
        name: of the scene.
        environment: the light to show it in; None for the studio.
        companions: the files beside it.
    Raises:
        SceneError: it is damaged, too large, or has no triangles.
    """
    warnings: list[Remark] = []
    obj = read_obj(data)
    library = _library(obj, companions, warnings)
    warnings.extend(unused(f"lines of kind {kind!r} are not used; only faces are") for kind in sorted(obj.left_out))
    maker = MaterialMaker(companions, warnings)
    numbers: dict[str, int] = {}
    materials: list[Material] = []
    emissions: list[F64] = []
    meshes: list[Mesh] = []
    taken: dict[str, int] = {}
    groups = obj.corners()
    if (colors := obj.vertex_colors()) is not None:
        if len(groups) == 1 and not obj.libraries:
            return _scan(next(iter(groups.values())), colors, name, environment, warnings)
        warnings.append(simplified("vertex colours are not used beside materials and objects of the .obj file"))
    for (thing, material), corners in groups.items():
        if material not in numbers:
            numbers[material] = len(materials)
            if material and obj.libraries and material not in library:
                warnings.append(wrong(f"material {material[:80]!r} is not described; it is grey"))
            materials.append(maker.make(material, library.get(material)))
            emissions.append(maker.emission(materials[-1], library.get(material)))
        own_name = unique_name(thing or material or "mesh", taken)
        number = numbers[material]
        mesh = make_mesh(corners, own_name, number, materials[number], f"mesh {own_name!r}", warnings)
        meshes.extend([] if mesh is None else [mesh])
    maker.warn_of_gloss()
    collector = LightCollector(warnings)
    lit = collector.shine(materials, emissions, meshes)
    return _scene(name, meshes, lit, environment, warnings, collector.lights)


def import_ply(data: bytes, name: str, environment: Environment | None) -> Scene:
    """Reads a Stanford .ply file, text or binary.

    Args:
        data: the file.
        name: of the scene.
        environment: the light to show it in; None for the studio.
    Raises:
        SceneError: it is damaged, too large, or has no triangles.
    """
    return _scan(*read_ply(data), name, environment, [])


def _scan(
    corners: Corners, colors: F32 | None, name: str, environment: Environment | None, warnings: list[Remark]
) -> Scene:
    """A mesh of one material, with the colours of its vertices."""
    corners, material = _colored(corners, colors, MaterialMaker(Alone(), warnings), warnings)
    mesh = make_mesh(corners, "mesh", 0, material, "the mesh", warnings)
    return _scene(name, [] if mesh is None else [mesh], [material], environment, warnings)


def _colored(
    corners: Corners, colors: F32 | None, maker: MaterialMaker, warnings: list[Remark]
) -> tuple[Corners, Material]:
    """A material with the colours of vertices (num_positions, 3), in an image where they differ; corners with places
    in it."""
    if colors is None:
        return corners, maker.make("material", None)
    opaque = np.concatenate([colors, np.ones((len(colors), 1), np.float32)], axis=1)
    vertices = corners.triangles[..., 0]
    is_drawn = not are_alike(opaque) and 0 < len(vertices) <= MAX_COLORED and vertices.max() < len(colors)
    if not is_drawn and not are_alike(opaque):
        warnings.append(simplified(f"vertex colours of more than {MAX_COLORED:,} triangles are replaced by their mean"))
    base = np.ones(3) if is_drawn else colors.mean(axis=0, dtype=np.float64)
    described = Described()
    described.numbers = {"Kd": [round(float(value), 6) for value in base], "Pr": [0.5]}
    material = maker.make("material", described)
    if not is_drawn or vertices.min() < 0:
        return corners, material
    image, places, _ = colors_as_image(opaque[vertices])
    own = np.arange(3 * len(vertices)).reshape(-1, 3)
    placed = replace(
        corners,
        uvs=places.reshape(-1, 2).astype(np.float64),
        triangles=np.stack([vertices, own, corners.triangles[..., 2]], axis=-1),
    )
    texture = Texture(np.ascontiguousarray(image[..., :3]), WRAP, Coding("srgb"))
    terms = ({**material.terms[0], "texture": "diffuse"}, *material.terms[1:])
    return placed, replace(material, terms=terms, textures={"diffuse": texture})


def _library(obj: Obj, companions: Companions, warnings: list[Remark]) -> dict[str, Described]:
    """All materials of all libraries; the first of a name wins."""
    if len(obj.libraries) > MAX_LIBRARIES:
        raise SceneError(f"the .obj file names more than {MAX_LIBRARIES} material files; join them")
    library: dict[str, Described] = {}
    for name in dict.fromkeys(obj.libraries):
        data = companions.read(name, "the material file")
        if data is None:
            shown = name[:60].encode("ascii", "replace").decode()
            warnings.append(wrong(f"the material file {shown!r} is not beside the scene; import both together"))
        else:
            library = read_library(data, posixpath.dirname(name.replace("\\", "/"))) | library
    return library


def _scene(
    name: str,
    meshes: list[Mesh],
    materials: Sequence[Material],
    environment: Environment | None,
    warnings: list[Remark],
    lights: Sequence[Light] = (),
) -> Scene:
    if not meshes:
        raise SceneError("the scene has no triangles with an area; export at least one mesh made of triangles")
    cameras = [framing_camera(meshes, "front")]
    return finished_scene(name, meshes, materials, cameras, environment or studio(), warnings, lights=lights)
