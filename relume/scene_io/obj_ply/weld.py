"""Meshes from triangles with separate indices of positions, UV coordinates and normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, unsupported
from relume.scene.model import F32, Material, Mesh
from relume.scene_io.gltf.geometry import find_nondegenerate, is_usable
from relume.scene_io.gltf.uvs import compute_tangents

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
CREASE = np.cos(np.radians(60.0))
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
    Raises:
        SceneError: a corner refers to a vertex that does not exist or is not finite.
    """
    triangles = corners.triangles
    for k, values in enumerate((corners.positions, corners.uvs, corners.normals)):
        lowest = 0 if k == 0 else -1
        if triangles.size and not lowest <= int(triangles[..., k].min()) <= int(triangles[..., k].max()) < len(values):
            raise SceneError(f"{label} has vertex indices out of range; export it again")
    used_vertices = np.unique(triangles[..., 0])
    if not is_usable(corners.positions[used_vertices]):
        raise SceneError(f"{label} has positions that are NaN, infinite or huge; repair and export it again")
    solid = find_nondegenerate(corners.positions, triangles[..., 0], label, warnings)
    triangles = triangles[solid]
    if len(triangles) == 0:
        warnings.append(unsupported(f"Skipped {label}: it has no triangles with an area."))
        return None
    points = corners.positions[triangles[..., 0]].astype(np.float32)
    normals = _normals(corners, triangles, points, label, warnings)
    uvs = _gather_values(corners.uvs, triangles[..., 1], 2, f"UV coordinates of {label}", warnings)
    faces = np.arange(3 * len(triangles), dtype=np.uint32).reshape(-1, 3)
    flat = points.reshape(-1, 3)
    tangents = np.zeros((len(flat), 4), np.float32)
    if material.normal_map is not None:
        tangents = compute_tangents(flat, normals, uvs, faces)
    return Mesh(name, flat, normals, tangents, uvs, faces, number)


def _gather_values(values: F64, indices: I64, width: int, label: str, warnings: list[ImporterWarning]) -> F32:
    """Values of the corners; zero if a corner has none or any is not finite. (num_corners, width)"""
    flat = indices.reshape(-1)
    gathered = np.zeros((len(flat), width))
    gathered[flat >= 0] = values[flat[flat >= 0]]
    if not is_usable(gathered):
        warnings.append(unsupported(f"Ignored the {label}: some values are NaN, infinite or huge."))
        return np.zeros(gathered.shape, np.float32)
    return gathered.astype(np.float32)


def _normals(corners: Corners, triangles: I64, points: F32, label: str, warnings: list[ImporterWarning]) -> F32:
    """Unit normals of the corners: the file's, or with a crease angle if it has none. (num_corners, 3)"""
    file_normals = _gather_values(corners.normals, triangles[..., 2], 3, f"normals of {label}", warnings).astype(
        np.float64
    )
    length = np.linalg.norm(file_normals, axis=1, keepdims=True)
    if (length > 1e-6).all():
        return np.asarray(file_normals / length, np.float32)
    creased = creased_normals(points.astype(np.float64), triangles[..., 0])
    return np.asarray(np.where(length > 1e-6, file_normals / np.maximum(length, 1e-6), creased), np.float32)


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
