"""Meshes from triangles whose corners number positions, texture coordinates and normals one by one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, unsupported
from relume.scene.model import F32, Material, Mesh
from relume.scene_io.gltf.geometry import find_nondegenerate, is_usable
from relume.scene_io.gltf.uvs import compute_tangents

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
CREASE = np.cos(np.radians(60.0))
MAX_FAN = 64  # triangles at a vertex that are compared one with another; more are averaged all together


@dataclass(frozen=True)
class Corners:
    """Triangles as a file numbers them: each corner names a position, a uv and a normal.

    Attributes:
        positions: (num_positions, 3). uvs: v from the top. (num_uvs, 2). normals: (num_normals, 3). float64
        triangles: for each corner the position, uv and normal, -1 where it has none. (num_triangles, 3, 3) int64
    """

    positions: F64
    uvs: F64
    normals: F64
    triangles: I64


def make_mesh(
    corners: Corners, name: str, number: int, material: Material, label: str, warnings: list[ImporterWarning]
) -> Mesh | None:
    """A mesh with own vertices for each corner; None where no triangle is left (a warning says so).

    Args:
        corners: the triangles, as the file numbers them.
        name: of the mesh.
        number: of its material in the scene.
        material: the same; a normal map needs tangents.
        label: names the mesh in errors and warnings.
        warnings: gets one sentence for each thing that is left out or replaced.
    Raises:
        SceneError: a corner names a vertex that there is not, or one that is not finite.
    """
    triangles = corners.triangles
    for k, values in enumerate((corners.positions, corners.uvs, corners.normals)):
        lowest = 0 if k == 0 else -1
        if triangles.size and not lowest <= int(triangles[..., k].min()) <= int(triangles[..., k].max()) < len(values):
            raise SceneError(f"{label} has faces of vertices that there are not; export it again")
    used_vertices = np.unique(triangles[..., 0])
    if not is_usable(corners.positions[used_vertices]):
        raise SceneError(f"{label} has positions that are not finite or out of range; repair and export it again")
    solid = find_nondegenerate(corners.positions, triangles[..., 0], label, warnings)
    triangles = triangles[solid]
    if len(triangles) == 0:
        warnings.append(unsupported(f"{label} has no triangles; it is left out"))
        return None
    points = corners.positions[triangles[..., 0]].astype(np.float32)
    normals = _normals(corners, triangles, points, label, warnings)
    uvs = _gather_values(corners.uvs, triangles[..., 1], 2, f"texture coordinates of {label}", warnings)
    faces = np.arange(3 * len(triangles), dtype=np.uint32).reshape(-1, 3)
    flat = points.reshape(-1, 3)
    tangents = np.zeros((len(flat), 4), np.float32)
    if material.normal_map is not None:
        tangents = compute_tangents(flat, normals, uvs, faces)
    return Mesh(name, flat, normals, tangents, uvs, faces, number)


def _gather_values(values: F64, indices: I64, width: int, label: str, warnings: list[ImporterWarning]) -> F32:
    """Values of the corners, zeros where a corner has none or none that is finite. (num_corners, width)"""
    flat = indices.reshape(-1)
    gathered = np.zeros((len(flat), width))
    gathered[flat >= 0] = values[flat[flat >= 0]]
    if not is_usable(gathered):
        warnings.append(unsupported(f"{label} are not all finite; they are not used"))
        return np.zeros(gathered.shape, np.float32)
    return gathered.astype(np.float32)


def _normals(corners: Corners, triangles: I64, points: F32, label: str, warnings: list[ImporterWarning]) -> F32:
    """Unit normals of the corners: the file's, and creased ones where it has none. (num_corners, 3)"""
    file_normals = _gather_values(corners.normals, triangles[..., 2], 3, f"normals of {label}", warnings).astype(
        np.float64
    )
    length = np.linalg.norm(file_normals, axis=1, keepdims=True)
    if (length > 1e-6).all():
        return np.asarray(file_normals / length, np.float32)
    creased = creased_normals(points.astype(np.float64), triangles[..., 0])
    return np.asarray(np.where(length > 1e-6, file_normals / np.maximum(length, 1e-6), creased), np.float32)


def creased_normals(points: F64, vertex_indices: I64) -> F64:
    """Area-weighted mean of the normals of the triangles at a vertex that lie within 60° of the corner's own.

    Args:
        points: (num_triangles, 3, 3). vertex_indices: which corners are the same point. (num_triangles, 3)
    Returns:
        (3 · num_triangles, 3), unit
    """
    cross = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    weighted = np.repeat(cross, 3, axis=0)
    unit = weighted / np.linalg.norm(weighted, axis=1, keepdims=True)
    order = np.argsort(vertex_indices.reshape(-1), kind="stable")
    vertex, area, corner_normals = vertex_indices.reshape(-1)[order], weighted[order], unit[order]
    total = area.copy()
    first = np.arange(len(vertex) - 1)
    for step in range(1, MAX_FAN):
        first = first[first + step < len(vertex)]
        first = first[vertex[first] == vertex[first + step]]
        if len(first) == 0:
            break
        smooth_pairs = first[(corner_normals[first] * corner_normals[first + step]).sum(1) > CREASE]
        total[smooth_pairs] += area[smooth_pairs + step]
        total[smooth_pairs + step] += area[smooth_pairs]
    length = np.linalg.norm(total, axis=1, keepdims=True)
    normals = np.empty_like(total)
    normals[order] = np.where(length > 0, total / np.where(length > 0, length, 1), corner_normals)
    return normals
