"""Meshes in world space: the transform of a node applied to a primitive with its material."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.scene.model import F32, Mesh
from relume.scene.tangents import compute_tangents, rotate_tangents
from relume.scene_io.gltf.degenerate_transforms import (
    cofactors,
    determinant,
    plane_normal,
    remove_degenerate,
)
from relume.scene_io.gltf.geometry import MAX_COORDINATE, GltfGeometry
from relume.scene_io.surfaces.make_material import ReadMaterial

F64 = NDArray[np.float64]


class BoundPrimitive(NamedTuple):
    """A primitive with the UV coordinates and index of its material."""

    geometry: GltfGeometry
    uvs: F32
    read_material: ReadMaterial
    material_index: int


def make_world_mesh(bound: BoundPrimitive, to_world: F64, num_dimensions: int, name: str) -> Mesh | None:
    """Transform geometry to world space; None if the result is degenerate. Mirroring flips the faces.

    Args:
        bound: primitive with its material. to_world: (4, 4). num_dimensions: rank of its linear part.
        name: name of the mesh.
    """
    geometry, uvs, read_material, material_index = bound
    linear = to_world[:3, :3]
    positions = geometry.positions @ linear.T + to_world[:3, 3]
    if num_dimensions < 2 or np.abs(positions).max() > MAX_COORDINATE:
        return None
    orientation = np.sign(determinant(linear)) if num_dimensions == 3 else 1.0
    faces = geometry.faces if orientation > 0 else np.ascontiguousarray(geometry.faces[:, ::-1])
    normals = _normalize(geometry.normals @ (orientation * cofactors(linear)).T)
    if num_dimensions == 2:
        faces = remove_degenerate(positions, faces)
        normals = np.where(normals.any(axis=1, keepdims=True), normals, plane_normal(linear))
        if not len(faces):
            return None
    tangents = np.zeros((len(positions), 4))
    tangents[:, :3] = _normalize(geometry.tangents[:, :3] @ linear.T)
    tangents[:, 3] = geometry.tangents[:, 3] * orientation
    mesh = Mesh(
        name,
        positions.astype(np.float32),
        normals.astype(np.float32),
        tangents.astype(np.float32),
        uvs,
        faces,
        material_index,
    )
    if read_material.material.normal_map is None and read_material.tangent_rotation is None:
        return mesh
    is_missing = ~mesh.tangents[:, :3].any(axis=1, keepdims=True)
    if is_missing.any():
        computed = compute_tangents(mesh.positions, mesh.normals, mesh.uvs, faces)
        mesh = replace(mesh, tangents=np.where(is_missing, computed, mesh.tangents))
    if not read_material.tangent_rotation:
        return mesh
    return replace(mesh, tangents=rotate_tangents(mesh.tangents, mesh.normals, read_material.tangent_rotation))


def _normalize(vectors: F64) -> F64:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))
