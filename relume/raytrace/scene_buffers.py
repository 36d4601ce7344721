"""All triangles of a scene in one set of arrays, as the kernels want them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.raytrace.alpha_filter import IGNORE_GLASS, AlphaTest
from relume.raytrace.alpha_test import collect_alpha_masks
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.embree import EmbreeScene
from relume.scene.merge_meshes import merge_meshes
from relume.scene.model import Scene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True)
class SceneBuffers:
    """All meshes of a scene, merged.

    Attributes:
        positions, normals: (num_vertices, 3) float32. tangents: (num_vertices, 4). uvs: (num_vertices, 2).
        faces: (num_faces, 3) uint32 into the above.
        face_material: index into the scene's materials. (num_faces,) int32
        face_mesh: index into the scene's meshes. (num_faces,) int32
        epsilon: how far ray origins are moved off the surface, metres.
    """

    positions: F32
    normals: F32
    tangents: F32
    uvs: F32
    faces: NDArray[np.uint32]
    face_material: NDArray[np.int32]
    face_mesh: NDArray[np.int32]
    embree: EmbreeScene
    epsilon: float

    @cached_property
    def face_normals(self) -> F32:
        """Unit normals of the triangles, their corners counter-clockwise. (num_faces, 3) float32"""
        a, b, c = self.positions[self.faces].astype(np.float64).transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300), np.float32)

    @cached_property
    def face_areas(self) -> F64:
        """Of the triangles, square metres. (num_faces,) float64"""
        a, b, c = self.positions[self.faces].astype(np.float64).transpose(1, 0, 2)
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)

    @cached_property
    def position_index(self) -> NDArray[np.intp]:
        """Numbers of the vertices' places: those in the same place have one. (num_vertices,)"""
        as_bytes = np.ascontiguousarray(self.positions, np.float32).view("V12").ravel()
        return np.asarray(np.unique(as_bytes, return_inverse=True)[1])

    def is_front(self, origin: F32, points: F32) -> NDArray[np.bool_]:
        """Tell which points on surfaces (n, 3) are seen from places, (3,) or (n, 3), on their outer side."""
        return is_front(self.embree, self.positions, self.faces, origin, points)


def offset_point(positions: F32) -> float:
    """Choose how far ray origins are moved off surfaces with these corners (n, 3), metres."""
    # float32 positions carry an error in proportion to their distance from the origin, so that counts besides the size
    return 1e-5 * float(np.abs(positions).max() + np.linalg.norm(np.ptp(positions, axis=0)))


def is_front(
    embree: EmbreeScene, positions: F32, faces: NDArray[np.uint32], origin: F32, points: F32
) -> NDArray[np.bool_]:
    """Tell which points on triangles are seen on their outer side.

    Args:
        embree: the triangles. positions: their vertices. (num_vertices, 3) float32. faces: (num_faces, 3) uint32
        origin: where they are seen from. (3,) float32, or (n, 3). points: on the triangles. (n, 3) float32
    Returns:
        (n,)
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
        epsilon=offset_point(mesh_buffers.positions),
    )
