"""Surfaces of a free-camera bake as read from its store: triangles, the lattice of probes on them, textures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import ChunkDamagedError
from relume.probes.lattice_nodes import LatticeNodes
from relume.probes.triangle_grids import ProbeGrid, num_nodes
from relume.raytrace.gather_rays import RayPattern, make_pattern
from relume.raytrace.scene_buffers import SceneBuffers, face_normals
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.surface_textures import NORMAL_MAP, Textures, read_textures, texture_coordinates
from relume.scene.model import Scene
from relume.store.bake_protocol import StoreReader

F16 = NDArray[np.float16]
F32 = NDArray[np.float32]


def corner_tangents(scene: Scene, geometry: SceneBuffers) -> Shaped[F16, "vertices_or_none 4"]:
    """Tangents of triangle corners with the sign of the bitangent; no rows if the scene has no normal map."""
    has_maps = any(material.normal_map is not None for material in scene.materials)
    return (geometry.tangents if has_maps else geometry.tangents[:0]).astype(np.float16)


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
    is_two_sided: Shaped[NDArray[np.bool_], " materials"]


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
        is_two_sided: of each material, whether it emits to both sides.
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
    is_two_sided: Shaped[NDArray[np.bool_], " materials"]

    def pixel_arrays(self) -> PixelArrays:
        """Return what the kernel of pixels reads."""
        return PixelArrays(
            self.textures, self.uvs, self.tangents, self.faces, self.uv_faces, self.face_material, self.face_normal,
            self.uv_scale, self.lattice_nodes.normal, self.is_two_sided,
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
        read_textures(store),
        face_fields[2],
        np.array(store.attributes["double_sided"], np.bool_),
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
    uv_scale = texture_coordinates(uvs, positions, faces).scale
    return uvs, tangents, faces, store.read("scene/face_material"), face_normals(positions, faces), uv_scale
