"""Meshes from triangles with separate indices of positions, UV coordinates and normals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, approximated, unsupported
from relume.core.numba_options import NO_REFCOUNT
from relume.scene.model import F32, Material, Mesh
from relume.scene.tangents import compute_tangents
from relume.scene_io.gltf.geometry import MAX_COORDINATE, find_nondegenerate, is_usable
from relume.scene_io.obj_ply.text import counted

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
CREASE = float(np.cos(np.radians(60.0)))
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
    if len(values) == 0:
        return np.zeros((len(flat), width)), 0
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
    if len(corners.normals) == 0:
        return creased_normals(points.astype(np.float64), triangles[..., 0]).astype(np.float32)
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
    vertex = np.ascontiguousarray(vertex_indices.ravel())
    fan_start = np.concatenate([[0], np.cumsum(np.bincount(vertex))])
    normals = np.empty((len(vertex), 3))
    _average_fans(vertex, fan_start, np.empty_like(vertex), cross, unit, normals)
    return normals


def compile_kernels() -> None:
    """Compile the kernel of `creased_normals`, or load it, by one triangle."""
    creased_normals(np.eye(3)[None], np.arange(3)[None])


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _average_fans(vertex, fan_start, fans, cross, unit, normals):  # type: ignore[no-untyped-def]
    """Average the triangles of each vertex for each of its corners.

    fans: memory for the corners of each vertex, in file order; those of vertex v begin at fan_start[v], which moves on.
    """
    for corner in range(len(vertex)):
        fans[fan_start[vertex[corner]]] = corner
        fan_start[vertex[corner]] += 1
        for axis in range(3):
            normals[corner, axis] = cross[corner // 3, axis]
    start = 0
    for v in range(len(fan_start) - 1):
        stop = fan_start[v]  # where the next fan began
        for k in range(start, stop):
            a = fans[k] // 3
            for other in range(k + 1, min(stop, k + MAX_FAN)):
                b = fans[other] // 3
                if unit[a, 0] * unit[b, 0] + unit[a, 1] * unit[b, 1] + unit[a, 2] * unit[b, 2] > CREASE:
                    for axis in range(3):
                        normals[fans[k], axis] += cross[b, axis]
                        normals[fans[other], axis] += cross[a, axis]
        start = stop
    for corner in range(len(vertex)):
        x, y, z = normals[corner, 0], normals[corner, 1], normals[corner, 2]
        length = math.sqrt(x * x + y * y + z * z)
        for axis in range(3):
            normals[corner, axis] = normals[corner, axis] / length if length > 0 else unit[corner // 3, axis]
