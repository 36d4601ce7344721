"""Meshes from triangles with separate indices of positions, UV coordinates and normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, approximated, unsupported
from relume.scene.model import F32, Material, Mesh
from relume.scene_io.gltf.geometry import MAX_COORDINATE, find_nondegenerate, is_usable
from relume.scene_io.gltf.uvs import compute_tangents
from relume.scene_io.obj_ply.text import counted

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
CREASE, HALF_CREASE = np.cos(np.radians([60.0, 30.0]))
MIN_NORMAL = 1e-6  # length of a normal that counts as one
MAX_FAN = 64  # triangles at a vertex that are compared pairwise; of more, only those close in file order


@dataclass(frozen=True)
class Corners:
    """Triangles with separate indices of positions, UVs and normals for each corner.

    Attributes:
        uvs: v from the top.
        triangles: indices of position, UV and normal for each corner, -1 if missing.
    """

    positions: Shaped[F64, "positions 3"]
    uvs: Shaped[F64, "uvs 2"]
    normals: Shaped[F64, "normals 3"]
    triangles: Shaped[I64, "triangles 3 3"]


def make_mesh(
    corners: Corners, name: str, number: int, material: Material, label: str, warnings: list[ImporterWarning]
) -> Mesh | None:
    """Make a mesh with separate vertices for each corner; None if no triangle is left, with a warning.

    Args:
        corners: the triangles of the file.
        name: name of the mesh.
        number: index of its material in the scene.
        material: the material; a normal map needs tangents.
        label: names the mesh in errors and warnings.
        warnings: gets one sentence for each omission or replacement.
    """
    triangles = corners.triangles
    if not is_usable(used_rows(corners.positions, triangles[..., 0])):
        warnings.append(unsupported(f"Skipped {label}: it has positions that are NaN, infinite or huge."))
        return None
    solid = find_nondegenerate(corners.positions, triangles[..., 0], label, warnings)
    triangles = triangles[solid]
    if len(triangles) == 0:
        warnings.append(unsupported(f"Skipped {label}: it has no triangles with an area."))
        return None
    points = corners.positions[triangles[..., 0]].astype(np.float32)
    normals = _normals(corners, triangles, points, label, warnings)
    uvs = _uvs(corners, triangles, label, warnings)
    faces = np.arange(3 * len(triangles), dtype=np.uint32).reshape(-1, 3)
    flat = points.reshape(-1, 3)
    tangents = np.zeros((len(flat), 4), np.float32)
    if material.normal_map is not None:
        tangents = compute_tangents(flat, normals, uvs, faces)
    return Mesh(name, flat, normals, tangents, uvs, faces, number)


def used_rows(values: Shaped[F64, "rows columns"], indices: I64) -> Shaped[F64, "used columns"]:
    """Rows that are named by at least one index, in their order."""
    is_used = np.zeros(len(values), np.bool_)
    is_used[indices] = True
    return values[is_used]


def _gather_values(values: F64, indices: I64, width: int) -> tuple[F64, int]:
    """Values of the corners, zero if a corner has none or one that is not usable; and the number of the latter."""
    flat = indices.reshape(-1)
    gathered = np.zeros((len(flat), width))
    gathered[flat >= 0] = values[flat[flat >= 0]]
    is_wrong = ~(np.abs(gathered) <= MAX_COORDINATE).all(axis=1)  # of NaN, too
    gathered[is_wrong] = 0
    return gathered, int(is_wrong.sum())


def _uvs(corners: Corners, triangles: I64, label: str, warnings: list[ImporterWarning]) -> F32:
    """UV coordinates of the corners; zero if a corner has none. (num_corners, 2)"""
    uvs, num_wrong = _gather_values(corners.uvs, triangles[..., 1], 2)
    if num_wrong:
        message = f"Set {counted(num_wrong, 'UV coordinate')} of {label} to zero: NaN, infinite or huge."
        warnings.append(unsupported(message))
    return uvs.astype(np.float32)


def _normals(corners: Corners, triangles: I64, points: F32, label: str, warnings: list[ImporterWarning]) -> F32:
    """Unit normals of the corners: the file's, or with a crease angle where it has none. (num_corners, 3)"""
    file_normals, num_wrong = _gather_values(corners.normals, triangles[..., 2], 3)
    length = np.linalg.norm(file_normals, axis=1, keepdims=True)
    is_given = length > MIN_NORMAL
    if num_wrong:
        message = f"Computed {counted(num_wrong, 'normal')} of {label}: NaN, infinite or huge in the file."
        warnings.append(approximated(message))
    num_zero = int((~is_given[triangles[..., 2].reshape(-1) >= 0]).sum()) - num_wrong
    if num_zero:
        warnings.append(approximated(f"Computed {counted(num_zero, 'normal')} of {label}: without length in the file."))
    if is_given.all():
        return np.asarray(file_normals / length, np.float32)
    creased = creased_normals(points.astype(np.float64), triangles[..., 0])
    return np.asarray(np.where(is_given, file_normals / np.where(is_given, length, 1), creased), np.float32)


def creased_normals(
    points: Shaped[F64, "triangles 3 3"], vertex_indices: Shaped[I64, "triangles 3"]
) -> Shaped[F64, "corners 3"]:
    """Compute area-weighted mean normals at a vertex over the triangles within 60° of the corner's own normal.

    Args:
        points: points of the corners. vertex_indices: corners with equal indices share a vertex.
    Returns:
        Unit normals of all corners.
    """
    cross = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    unit = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    sums = np.stack([np.bincount(vertex_indices.ravel(), np.repeat(column, 3)) for column in cross.T], axis=1)
    means = (sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), np.finfo(float).tiny))[vertex_indices]
    is_smooth = np.ones(len(sums), np.bool_)  # each triangle within 30° of the mean: each pair within 60°
    is_smooth[vertex_indices[np.einsum("tc,tkc->tk", unit, means) <= HALF_CREASE]] = False
    creased = np.flatnonzero(~is_smooth[vertex_indices.ravel()])
    normals = means.reshape(-1, 3)
    normals[creased] = _pairwise_normals(vertex_indices.ravel()[creased], cross[creased // 3], unit[creased // 3])
    return normals


def _pairwise_normals(vertex_indices: Shaped[I64, " corners"], cross: F64, unit: F64) -> Shaped[F64, "corners 3"]:
    """Compare each corner with all others of its vertex."""
    order = np.argsort(vertex_indices, kind="stable")
    vertex, area, corner_normals = vertex_indices[order], cross[order], unit[order]
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
