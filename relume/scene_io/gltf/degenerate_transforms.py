"""Meshes with a degenerate transform that flattens them to a plane; they stay visible from both sides."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F64 = NDArray[np.float64]
U32 = NDArray[np.uint32]

_MIN_RELATIVE_SCALE = 1e-9  # of the largest scale; smaller ones count as zero
_MIN_SCALE = 1e-15  # of the largest scale
_MIN_RELATIVE_DETERMINANT = 1e-6  # of the cube of the largest entry; above, all three dimensions remain


def count_dimensions(linear: Shaped[F64, "3 3"]) -> int:
    """Rank of a linear transform."""
    largest = float(np.abs(linear).max())
    if (
        abs(determinant(linear)) > _MIN_RELATIVE_DETERMINANT * largest**3
        and largest > 1 / _MIN_RELATIVE_DETERMINANT * _MIN_SCALE
    ):
        return 3  # the smallest scale is at least the determinant over the square of the largest
    scales = np.linalg.svd(linear, compute_uv=False)
    return int(np.count_nonzero(scales > max(_MIN_RELATIVE_SCALE * float(scales[0]), _MIN_SCALE)))


def determinant(linear: Shaped[F64, "3 3"]) -> float:
    """Determinant, by the rule of Sarrus."""
    (a, b, c), (d, e, f), (g, h, i) = linear.tolist()
    return float(a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g))


def cofactors(linear: Shaped[F64, "3 3"]) -> Shaped[F64, "3 3"]:
    """Cofactor matrix: transforms normals like the inverse transpose, and exists for singular transforms, too."""
    (a, b, c), (d, e, f), (g, h, i) = linear.tolist()  # faster than NumPy: a scene has up to 100,000 nodes
    return np.array([
        [e * i - f * h, f * g - d * i, d * h - e * g],
        [h * c - i * b, i * a - g * c, g * b - h * a],
        [b * f - c * e, c * d - a * f, a * e - b * d],
    ])  # fmt: skip


def remove_degenerate(positions: Shaped[F64, "n 3"], faces: Shaped[U32, "triangles 3"]) -> Shaped[U32, "remaining 3"]:
    """Return the faces that have an area."""
    a, b, c = positions[faces].transpose(1, 0, 2)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.square(np.stack([b - a, c - b, a - c])).sum(axis=2).max(axis=0)
    return np.ascontiguousarray(faces[doubled > _MIN_RELATIVE_SCALE * np.maximum(longest, 1e-300)])


def plane_normal(linear: Shaped[F64, "3 3"]) -> Shaped[F64, " 3"]:
    """Unit normal of the plane onto which a transform of rank two projects."""
    return np.asarray(np.linalg.svd(linear)[0][:, 2])
