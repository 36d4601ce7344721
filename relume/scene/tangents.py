"""Tangents along the u axis of texture coordinates, for normal maps and anisotropic highlights."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped

from relume.scene.model import F32, U32


def compute_tangents(
    positions: Shaped[F32, "vertices 3"],
    normals: Shaped[F32, "vertices 3"],
    uvs: Shaped[F32, "vertices 2"],
    faces: Shaped[U32, "triangles 3"],
) -> Shaped[F32, "vertices 4"]:
    """Compute unit tangents along u, averaged over the triangles of a vertex, with the handedness ±1 in w.

    The bitangent cross(normal, tangent)·w points toward −v, which is up, as the green channel of normal maps expects.

    Args:
        positions: positions of the vertices. normals: unit.
        uvs: UV coordinates, v from the top.
        faces: indices of the triangles' vertices.
    """
    p, uv = positions[faces].astype(np.float64), uvs[faces].astype(np.float64)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    (du1, dv1), (du2, dv2) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    orientation = np.sign(du1 * dv2 - du2 * dv1)
    # Divided by the determinant these would be dP/du and dP/dv; without the division, large triangles count more.
    along = (e1 * dv2[:, None] - e2 * dv1[:, None]) * orientation[:, None]
    down = (e2 * du1[:, None] - e1 * du2[:, None]) * orientation[:, None]
    tangents, bitangents = np.zeros(positions.shape), np.zeros(positions.shape)
    for corner in range(3):
        np.add.at(tangents, faces[:, corner], along)
        np.add.at(bitangents, faces[:, corner], down)
    tangents -= normals * (normals * tangents).sum(1, keepdims=True)
    length = np.linalg.norm(tangents, axis=1, keepdims=True)
    tangents = np.where(length > 1e-20, tangents / np.maximum(length, 1e-20), 0)
    is_mirrored = (np.cross(normals, tangents) * bitangents).sum(1) > 0
    return np.column_stack([tangents, np.where(is_mirrored, -1.0, 1.0)]).astype(np.float32)


def rotate_tangents(
    tangents: Shaped[F32, "vertices 4"], normals: Shaped[F32, "vertices 3"], angle: float
) -> Shaped[F32, "vertices 4"]:
    """Rotate tangents toward the bitangent cross(normal, tangent)·w.

    Args:
        tangents: unit, with the handedness ±1 in w.
        normals: unit.
        angle: radians.
    """
    along, handedness = tangents[:, :3], tangents[:, 3:]
    rotated = np.cos(angle) * along + np.sin(angle) * np.cross(normals, along) * handedness
    return np.column_stack([rotated, handedness]).astype(np.float32)
