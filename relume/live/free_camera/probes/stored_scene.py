"""What a moving eye sees of a store: triangles, the lattice of points on them, textures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.texture_slots import TEXTURES
from relume.core.errors import ChunkDamagedError, StoreError
from relume.live.free_camera.probes.lattice_nodes import LatticeNodes
from relume.live.free_camera.probes.triangle_grids import ProbeGrid, num_nodes
from relume.raytrace.gather_rays import RayPattern, make_pattern
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.texture import MipMap
from relume.scene.model import WRAPS, Scene, Texture
from relume.store.bake_protocol import StoreReader

F16 = NDArray[np.float16]
F32 = NDArray[np.float32]

MAX_TEXTURE_SIDE = 2048  # what an eye that moves is shown; finer levels are left out
_MAX_TEXELS = 1 << 25  # of all finest levels; values are kept as floats, 12 bytes each
NORMAL_MAP, EMISSION = len(TEXTURES), len(TEXTURES) + 1  # their columns in `Textures.of_material`
_MAX_VALUE = 6e4  # of half precision


class SceneTextures(NamedTuple):
    """Textures as a store keeps them.

    Attributes:
        arrays: "textures/<k>", (height, width, 3) float16.
        attributes: attributes of the store: which texture each material has in each of `TEXTURES`, which normal map and
            which image of what it shines, −1 for none, and how each texture continues outside.
    """

    arrays: dict[str, NDArray[Any]]
    attributes: dict[str, Any]


def collect_textures(scene: Scene) -> SceneTextures:
    """Collect the textures of a scene's materials, each once, at most `MAX_TEXTURE_SIDE` wide and high."""
    index_by_id: dict[int, int] = {}
    textures: list[Texture] = []

    def texture_index(texture: Texture | None) -> int:
        if texture is None:
            return -1
        if id(texture) not in index_by_id:
            index_by_id[id(texture)] = len(textures)
            textures.append(texture)
        return index_by_id[id(texture)]

    attributes = {
        "textures": [[texture_index(m.textures.get(name)) for name in TEXTURES] for m in scene.materials],
        "normal_maps": [texture_index(m.normal_map) for m in scene.materials],
        "emission_images": [texture_index(m.textures.get("emission")) for m in scene.materials],
    }
    side = _max_side(textures)
    finest = [np.minimum(_level_pixels(texture, side), _MAX_VALUE) for texture in textures]
    arrays = {f"textures/{k}": pixels.astype(np.float16) for k, pixels in enumerate(finest)}
    wraps = [[WRAPS.index(wrap) for wrap in texture.wrap] for texture in textures]
    return SceneTextures(arrays, {**attributes, "wraps": wraps})


def corner_tangents(scene: Scene, geometry: SceneBuffers) -> F16:
    """What normal maps of a scene lie along: tangents of the triangles' corners, none where there is no such map.

    Returns:
        With the sign of the bitangent. (num_vertices or 0, 4)
    """
    has_maps = any(material.normal_map is not None for material in scene.materials)
    return (geometry.tangents if has_maps else geometry.tangents[:0]).astype(np.float16)


def _max_side(textures: Sequence[Texture]) -> int:
    """How wide and high they may be for all to have at most `_MAX_TEXELS`."""
    side, pyramids = MAX_TEXTURE_SIDE, [MipMap.for_texture(texture) for texture in textures]
    while side > 1 and sum(p.levels[_level_index(p, side)].size // 3 for p in pyramids) > _MAX_TEXELS:
        side //= 2
    return side


def _level_pixels(texture: Texture, side: int) -> F32:
    pyramid = MipMap.for_texture(texture)
    return pyramid.level(_level_index(pyramid, side))


def _level_index(pyramid: MipMap, side: int) -> int:
    return next(k for k, level in enumerate(pyramid.levels) if max(level.shape[:2]) <= side)


class Textures(NamedTuple):
    """All textures with their halvings, one after another.

    Attributes:
        texels: (texels, 3) float32
        levels: first texel, height, width of each level, finest first. (levels, 3) int64
        first: of each texture, where its levels begin; one more at the end. (textures + 1,) int64
        wraps: how u and v continue: repeat, mirror, clamp. (textures, 2) int64
        material_textures: texture of each material in each of `TEXTURES`, then its normal map, then the image of what
            it shines, −1 for none. (materials, 4) int64
    """

    texels: F32
    levels: NDArray[np.int64]
    first: NDArray[np.int64]
    wraps: NDArray[np.int64]
    material_textures: NDArray[np.int64]


@dataclass(frozen=True)
class StoredScene:
    """The surfaces of a bake as an eye sees them.

    Attributes:
        lattice_nodes: of the lattice, which follow from points.
        probes: that light is kept at. material: of each. (n,) uint16
        uvs: places in textures, of the triangles' corners. (num_vertices, 2) float32
        tangents: along u, of the same, with the sign of the bitangent; empty where no material has a normal map.
            (num_vertices, 4) float32
        faces: the triangles. (num_faces, 3) uint32. face_material: of each. (num_faces,) int32
        uv_faces: the triangles' corners among `uvs`. (num_faces, 3) uint32
        face_normal: where the corners are counter-clockwise, unit. (num_faces, 3) float32
        uv_scale: side in textures of a square metre of each. (num_faces,) float32
    """

    probe_grid: ProbeGrid
    lattice_nodes: LatticeNodes
    probes: SurfacePoints
    material: NDArray[np.uint16]
    uvs: F32
    tangents: F32
    faces: NDArray[np.uint32]
    face_material: NDArray[np.int32]
    face_normal: F32
    uv_scale: F32
    textures: Textures
    uv_faces: NDArray[np.uint32]

    @cached_property
    def normal_variation(self) -> F32:
        """The variance of the normals of each material about their mean, from its map's coarsest level; nothing where
        it has no map. (materials,) float32"""
        textures = self.textures
        out = np.zeros(len(textures.material_textures), np.float32)
        for material, texture in enumerate(textures.material_textures[:, NORMAL_MAP]):
            if texture >= 0:
                start, height, width = textures.levels[textures.first[texture + 1] - 1]
                mean = textures.texels[start : start + height * width].mean(axis=0)
                out[material] = max(1 - float(mean @ mean), 0)
        return out


def read_probes(store: StoreReader, start: int = 0, stop: int | None = None) -> SurfacePoints:
    """Read points [start, stop) of a store.

    All have one seed: their rays go alike, so that what few rays miss changes smoothly from point to point.
    """
    position, normal, tangent = (
        store.read(f"probes/{name}", start, stop) for name in ("position", "normal", "tangent")
    )
    return SurfacePoints(position, normal, tangent, np.zeros(len(position), np.uint32))


def ray_pattern(store: StoreReader, num_rays: int) -> RayPattern:
    """Make the pattern of the points' gather rays again."""
    return make_pattern(num_rays, 0, int(store.attributes["gather_seed"]) + 1)


def read_stored_scene(store: StoreReader) -> StoredScene:
    """Read all of it.

    Raises:
        ChunkDamagedError: arrays of the store do not fit each other. StoreError: its description is not of this form.
    """
    probe_grid = ProbeGrid(*(store.read(f"nodes/{name}") for name in ProbeGrid._fields))
    lattice_nodes = LatticeNodes(*(store.read(f"nodes/{name}") for name in LatticeNodes._fields))
    face_fields = _read_faces(store)
    surface = StoredScene(
        probe_grid,
        lattice_nodes,
        read_probes(store),
        store.read("probes/material"),
        *face_fields,
        _read_textures(store),
        face_fields[2],
    )
    has_maps = bool((surface.textures.material_textures[:, NORMAL_MAP] >= 0).any())
    if has_maps and len(surface.tangents) != len(surface.uvs):
        raise ChunkDamagedError("scene/tangents", "there are normal maps, and corners without a tangent")
    num_probes, num_materials = surface.probes.num_points, len(store.attributes["materials"])
    ends = probe_grid.first.astype(np.int64) + num_nodes(probe_grid.num_rows)
    fits = probe_grid.num_rows.shape == probe_grid.first.shape == (len(surface.face_material), 2)
    if (
        not fits
        or ends.max() > len(probe_grid.node_index)
        or int(probe_grid.node_index.max(initial=0)) >= len(lattice_nodes.normal)
    ):
        raise ChunkDamagedError("nodes", "the probe grids do not fit the lattice nodes")
    if num_probes == 0 or int(lattice_nodes.probe.max(initial=0)) >= num_probes:
        raise ChunkDamagedError("nodes", "the lattice nodes do not fit the probes")
    if max(int(surface.material.max()), int(surface.face_material.max())) >= num_materials:
        raise ChunkDamagedError("probes", "a probe has a material that the scene has not")
    return surface


def _read_faces(store: StoreReader) -> tuple[F32, F32, NDArray[np.uint32], NDArray[np.int32], F32, F32]:
    """The fields `uvs` to `uv_scale` of `Surface`."""
    positions, faces, uvs = (store.read(f"scene/{name}") for name in ("positions", "faces", "uvs"))
    tangents = store.read("scene/tangents").astype(np.float32)
    if int(faces.max(initial=0)) >= min(len(positions), len(uvs)):
        raise ChunkDamagedError("scene/faces", "a triangle has a corner that the scene has not")
    a, b, c = positions[faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    twice_area = np.maximum(np.linalg.norm(normal, axis=1), 1e-20)
    (du_0, dv_0), (du_1, dv_1) = (uvs[faces][:, k].T - uvs[faces][:, 0].T for k in (1, 2))
    uv_scale = np.sqrt(np.abs(du_0 * dv_1 - dv_0 * du_1) / twice_area)
    face_normal = (normal / twice_area[:, None]).astype(np.float32)
    return uvs, tangents, faces, store.read("scene/face_material"), face_normal, uv_scale.astype(np.float32)


def _read_textures(store: StoreReader) -> Textures:
    try:
        channel_textures = np.array(store.attributes["textures"], np.int64).reshape(-1, len(TEXTURES))
        # older stores do not say
        emission_textures = store.attributes.get("emission_images", [-1] * len(channel_textures))
        material_textures = np.column_stack(
            [channel_textures, np.array([store.attributes["normal_maps"], emission_textures], np.int64).T]
        )
        wraps = np.array(store.attributes["wraps"], np.int64).reshape(-1, 2)
    except (KeyError, TypeError, ValueError) as error:
        raise StoreError(f"the store does not describe its textures ({error}); bake the scene again") from error
    if material_textures.size and not -1 <= material_textures.min() <= material_textures.max() < len(wraps):
        raise ChunkDamagedError("textures", "a material has a texture that the store has not")
    textures = (Texture(store.read(f"textures/{k}").astype(np.float32)) for k in range(len(wraps)))
    return Textures(*concatenate_textures(textures), wraps, material_textures)


class ConcatenatedTextures(NamedTuple):
    """Levels of textures one after another, as in `Textures`."""

    texels: F32
    levels: NDArray[np.int64]
    first: NDArray[np.int64]


def concatenate_textures(textures: Iterable[Texture], max_side: int = MAX_TEXTURE_SIDE) -> ConcatenatedTextures:
    """Stack textures with their halvings.

    Args:
        textures: in their order. max_side: texels; levels that are wider or higher are left out.
    """
    texels, levels, first, end = [np.empty((0, 3), np.float32)], [], [0], 0
    for texture in textures:
        pyramid = MipMap.for_texture(texture)
        for level in map(pyramid.level, range(_level_index(pyramid, max_side), len(pyramid.levels))):
            levels.append((end, *level.shape[:2]))
            texels.append(level.reshape(-1, 3))
            end += len(texels[-1])
        first.append(len(levels))
    return ConcatenatedTextures(
        np.concatenate(texels), np.array(levels, np.int64).reshape(-1, 3), np.array(first, np.int64)
    )
