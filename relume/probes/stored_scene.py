"""Surfaces of a free-camera bake as read from its store: triangles, the lattice of probes on them, textures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.texture_slots import TEXTURES
from relume.core.errors import ChunkDamagedError, StoreError
from relume.probes.lattice_nodes import LatticeNodes
from relume.probes.triangle_grids import ProbeGrid, num_nodes
from relume.raytrace.gather_rays import RayPattern, make_pattern
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.texture import MipMap
from relume.scene.model import WRAPS, Scene, Texture
from relume.store.bake_protocol import StoreReader

F16 = NDArray[np.float16]
F32 = NDArray[np.float32]

MAX_TEXTURE_SIDE = 2048  # finer mip levels are not stored
_MAX_TEXELS = 1 << 25  # of all finest levels together; 12 bytes each
NORMAL_MAP, EMISSION = len(TEXTURES), len(TEXTURES) + 1  # their columns in `Textures.of_material`
_MAX_VALUE = 6e4  # of half precision


class SceneTextures(NamedTuple):
    """Textures in the form of a store.

    Attributes:
        arrays: "textures/<k>", (height, width, 3) float16.
        attributes: attributes of the store: texture of each material in each of `TEXTURES`, its normal map and its
            emission image, −1 for none, and the wrap modes of each texture.
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


def corner_tangents(scene: Scene, geometry: SceneBuffers) -> Shaped[F16, "vertices_or_none 4"]:
    """Tangents of triangle corners with the sign of the bitangent; no rows if the scene has no normal map."""
    has_maps = any(material.normal_map is not None for material in scene.materials)
    return (geometry.tangents if has_maps else geometry.tangents[:0]).astype(np.float16)


def _max_side(textures: Sequence[Texture]) -> int:
    """Largest texture side for which all textures together have at most `_MAX_TEXELS`."""
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
    """All textures with their mip levels, concatenated.

    Attributes:
        levels: first texel, height and width of each level, finest first. first: first level of each texture; one more
            at the end. wraps: wraps of u and v: repeat, mirror, clamp.
        material_textures: texture of each material in each of `TEXTURES`, its normal map, its emission image; −1 for
            none.
    """

    texels: Shaped[F32, "texels 3"]
    levels: Shaped[NDArray[np.int64], "levels 3"]
    first: Shaped[NDArray[np.int64], " textures_and_end"]
    wraps: Shaped[NDArray[np.int64], "textures 2"]
    material_textures: Shaped[NDArray[np.int64], "materials 4"]


class PixelArrays(NamedTuple):
    """Surfaces of a `StoredScene` as the kernel of pixels reads them. node_normal: of lattice nodes."""

    textures: Textures
    uvs: F32
    tangents: F32
    faces: Shaped[NDArray[np.uint32], "faces 3"]
    uv_faces: Shaped[NDArray[np.uint32], "faces 3"]
    face_material: Shaped[NDArray[np.int32], " faces"]
    face_normal: Shaped[F32, "faces 3"]
    uv_scale: Shaped[F32, " faces"]
    node_normal: Shaped[F32, "nodes 3"]


class ViewedProbes(NamedTuple):
    """Probes to shade for a camera, for kernels.

    Attributes:
        points, material: of all probes. camera_position: meters. rows: the probes to shade.
    """

    points: SurfacePoints
    material: Shaped[NDArray[np.uint16], " probes"]
    camera_position: Shaped[F32, " 3"]
    rows: Shaped[NDArray[np.intp], " m"]


@dataclass(frozen=True)
class StoredScene:
    """Surfaces of a bake for a free camera.

    Attributes:
        lattice_nodes: interpolated from probes. probes: where light is stored. material: material of each probe.
        uvs: texture coordinates of triangle corners.
        tangents: tangents of the corners, with the sign of the bitangent; empty if
            no material has a normal map. face_material: face material of each triangle.
        uv_faces: corners of the triangles among
            `uvs`.
        face_normal: unit, on the side from which the corners are counterclockwise. uv_scale: texture units per meter.
    """

    probe_grid: ProbeGrid
    lattice_nodes: LatticeNodes
    probes: SurfacePoints
    material: Shaped[NDArray[np.uint16], " probes"]
    uvs: F32
    tangents: F32
    faces: Shaped[NDArray[np.uint32], "faces 3"]
    face_material: Shaped[NDArray[np.int32], " faces"]
    face_normal: Shaped[F32, "faces 3"]
    uv_scale: Shaped[F32, " faces"]
    textures: Textures
    uv_faces: Shaped[NDArray[np.uint32], "faces 3"]

    def pixel_arrays(self) -> PixelArrays:
        """Return what the kernel of pixels reads."""
        return PixelArrays(
            self.textures, self.uvs, self.tangents, self.faces, self.uv_faces, self.face_material, self.face_normal,
            self.uv_scale, self.lattice_nodes.normal,
        )  # fmt: skip

    def viewed_from(
        self, camera_position: Shaped[NDArray[np.floating], " 3"], is_needed: Shaped[NDArray[np.uint8], " probes"]
    ) -> ViewedProbes:
        """Select probes to shade. camera_position: meters. is_needed: nonzero for these probes."""
        rows = np.flatnonzero(is_needed.view(np.bool_))
        return ViewedProbes(self.probes, self.material, np.ascontiguousarray(camera_position, np.float32), rows)

    @cached_property
    def normal_variation(self) -> Shaped[F32, " materials"]:
        """Variance of the normals of each material about their mean, from the coarsest level of its map; zero without a
        map.
        """
        textures = self.textures
        out = np.zeros(len(textures.material_textures), np.float32)
        for material, texture in enumerate(textures.material_textures[:, NORMAL_MAP]):
            if texture >= 0:
                start, height, width = textures.levels[textures.first[texture + 1] - 1]
                mean = textures.texels[start : start + height * width].mean(axis=0)
                out[material] = max(1 - float(mean @ mean), 0)
        return out


def read_probes(store: StoreReader, start: int = 0, stop: int | None = None) -> SurfacePoints:
    """Read probes [start, stop) of a store.

    All have the same seed, so that their rays have the same directions and sampling error varies smoothly between
    probes.
    """
    position, normal, tangent = (
        store.read(f"probes/{name}", start, stop) for name in ("position", "normal", "tangent")
    )
    return SurfacePoints(position, normal, tangent, np.zeros(len(position), np.uint32))


def ray_pattern(store: StoreReader, num_rays: int) -> RayPattern:
    """Recreate the pattern of the probes' gather rays."""
    return make_pattern(num_rays, 0, int(store.attributes["gather_seed"]) + 1)


def read_stored_scene(store: StoreReader) -> StoredScene:
    """Read the surfaces of a bake.

    Raises:
        ChunkDamagedError: arrays are inconsistent. StoreError: an attribute is missing.
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
    """Read the fields `uvs` to `uv_scale` of `StoredScene`."""
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
        # absent in older stores
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
    """Mip levels of textures, concatenated as in `Textures`."""

    texels: F32
    levels: NDArray[np.int64]
    first: NDArray[np.int64]


def concatenate_textures(textures: Iterable[Texture], max_side: int = MAX_TEXTURE_SIDE) -> ConcatenatedTextures:
    """Concatenate textures with their mip levels.

    Args:
        textures: in order. max_side: texels; levels that are wider or higher are omitted.
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
