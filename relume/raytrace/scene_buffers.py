"""All triangles of a scene in one set of arrays, for kernels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.raytrace.alpha_filter import IGNORE_GLASS, AlphaTest
from relume.raytrace.alpha_test import collect_alpha_masks
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.ray_origins import OriginMesh
from relume.scene.merge_meshes import merge_meshes
from relume.scene.model import Scene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True)
class SceneBuffers:
    """All meshes of a scene, merged.

    Attributes:
        positions, normals, tangents, uvs: positions, normals, tangents and UV coordinates of the vertices; tangents
            have the sign of the bitangent. All but positions may be empty, for rays that only need the geometry.
        faces: vertex indices of the corners.
        face_material: index into the scene's materials.
        face_mesh: index into the scene's meshes.
    """

    positions: Shaped[F32, "vertices 3"]
    normals: Shaped[F32, "shaded 3"]
    tangents: Shaped[F32, "shaded 4"]
    uvs: Shaped[F32, "shaded 2"]
    faces: Shaped[NDArray[np.uint32], "faces 3"]
    face_material: Shaped[NDArray[np.int32], " faces"]
    face_mesh: Shaped[NDArray[np.int32], " faces"]
    embree: EmbreeScene

    @cached_property
    def face_normals(self) -> Shaped[F32, "faces 3"]:
        """Unit normals of the triangles, with their corners counterclockwise."""
        return face_normals(self.positions, self.faces)

    @cached_property
    def origins(self) -> OriginMesh:
        """The triangles, as origins of rays."""
        return OriginMesh.build(self.positions, self.faces, self.face_normals)

    @cached_property
    def face_areas(self) -> Shaped[F64, " faces"]:
        """Areas of the triangles, square meters."""
        a, b, c = self.positions[self.faces].astype(np.float64).transpose(1, 0, 2)
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)

    @cached_property
    def position_index(self) -> Shaped[NDArray[np.intp], " vertices"]:
        """Index of each vertex's distinct position."""
        as_bytes = np.ascontiguousarray(self.positions, np.float32).view("V12").ravel()
        return np.asarray(np.unique(as_bytes, return_inverse=True)[1])

    def smooth_normals(self, face: NDArray[np.int32], uv: Shaped[F32, "n 2"]) -> Shaped[F32, "n 3"]:
        """Unit normals at hits, interpolated without normal maps; `surface_at` takes several times as long.

        Args:
            face: triangles. uv: barycentric coordinates of their second and third corner.
        """
        corners, (u, v) = self.normals[self.faces[face]], uv.T[:, :, None]
        normal = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
        return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12))

    def is_front(self, origin: F32, points: Shaped[F32, "n 3"]) -> Shaped[NDArray[np.bool_], " n"]:
        """True for points on surfaces whose outer side faces an origin, (3,) or (n, 3)."""
        return is_front(self.embree, self.positions, self.faces, origin, points)


def face_normals(
    positions: Shaped[F32, "vertices 3"], faces: Shaped[NDArray[np.uint32], "faces 3"]
) -> Shaped[F32, "faces 3"]:
    """Unit normals of triangles, with their corners counterclockwise; zero without an area."""
    a, b, c = positions[faces].astype(np.float64).transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300), np.float32)


def is_front(
    embree: EmbreeScene,
    positions: Shaped[F32, "vertices 3"],
    faces: Shaped[NDArray[np.uint32], "faces 3"],
    origin: F32,
    points: Shaped[F32, "n 3"],
) -> Shaped[NDArray[np.bool_], " n"]:
    """True for rays whose first hit shows the outer side of its triangle.

    Args:
        embree: the triangles. positions: their vertices. faces: vertex indices.
        origin: origins of the rays. (3,) or (n, 3). points: points on triangles; the rays' targets.
    """
    directions = (points - origin) / np.linalg.norm(points - origin, axis=1, keepdims=True)
    face = trace_rays(embree, origin, directions.astype(np.float32), IGNORE_GLASS).face
    a, b, c = positions[faces[np.maximum(face, 0)]].transpose(1, 0, 2)
    return np.asarray(np.einsum("nc,nc->n", np.cross(b - a, c - a), directions) < 0)


def build_scene_buffers(scene: Scene) -> SceneBuffers:
    """Merge the meshes of a scene and build Embree's tree over them.

    Raises:
        SceneError: the scene has no triangles.
    """
    if not any(len(mesh.faces) for mesh in scene.meshes):
        raise SceneError("the scene has no triangles; add a mesh")
    mesh_buffers = merge_meshes(scene.meshes)
    counts = [len(mesh.faces) for mesh in scene.meshes]
    face_material = np.repeat([mesh.material for mesh in scene.meshes], counts).astype(np.int32)
    alpha_masks = collect_alpha_masks(scene.materials)
    alpha_test = (
        None
        if alpha_masks is None
        else AlphaTest.build(mesh_buffers.faces, mesh_buffers.positions, mesh_buffers.uvs, face_material, alpha_masks)
    )
    return SceneBuffers(
        positions=mesh_buffers.positions,
        normals=mesh_buffers.normals,
        tangents=mesh_buffers.tangents,
        uvs=mesh_buffers.uvs,
        faces=mesh_buffers.faces,
        face_material=face_material,
        face_mesh=np.repeat(np.arange(len(scene.meshes)), counts).astype(np.int32),
        embree=EmbreeScene.build(mesh_buffers.positions, mesh_buffers.faces, alpha_test),
    )
