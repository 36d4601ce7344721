"""Meshes whose transform flattens them: shown as what is left of them, a piece of a plane with two sides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
U32 = NDArray[np.uint32]

_MIN_RELATIVE_SCALE = 1e-9  # of the largest of a transform's three scales, below which another is none
_MIN_SCALE = 1e-15  # of the largest, metres a metre
_MIN_RELATIVE_DETERMINANT = (
    1e-6  # of the cube of a transform's largest number: with such a determinant it keeps three dimensions
)


def count_dimensions(linear: F64) -> int:
    """How many dimensions a transform leaves of three. linear: (3, 3)"""
    largest = float(np.abs(linear).max())
    if (
        abs(determinant(linear)) > _MIN_RELATIVE_DETERMINANT * largest**3
        and largest > 1 / _MIN_RELATIVE_DETERMINANT * _MIN_SCALE
    ):
        return 3  # the smallest of three scales is at least the determinant over the square of the largest
    scales = np.linalg.svd(linear, compute_uv=False)
    return int(np.count_nonzero(scales > max(_MIN_RELATIVE_SCALE * float(scales[0]), _MIN_SCALE)))


def determinant(linear: F64) -> float:
    """By the rule of Sarrus. linear: (3, 3)"""
    (a, b, c), (d, e, f), (g, h, i) = linear.tolist()
    return float(a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g))


def cofactors(linear: F64) -> F64:
    """What normals are multiplied by: the inverse transposed times the determinant, which flat ones have too. (3, 3)"""
    (a, b, c), (d, e, f), (g, h, i) = linear.tolist()  # a scene has a hundred thousand of these
    return np.array([
        [e * i - f * h, f * g - d * i, d * h - e * g],
        [h * c - i * b, i * a - g * c, g * b - h * a],
        [b * f - c * e, c * d - a * f, a * e - b * d],
    ])  # fmt: skip


def remove_degenerate(positions: F64, faces: U32) -> U32:
    """The faces that have an area left. positions: (n, 3) faces: (f, 3)"""
    a, b, c = positions[faces].transpose(1, 0, 2)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.square(np.stack([b - a, c - b, a - c])).sum(axis=2).max(axis=0)
    return np.ascontiguousarray(faces[doubled > _MIN_RELATIVE_SCALE * np.maximum(longest, 1e-300)])


def plane_normal(linear: F64) -> F64:
    """The unit normal of the plane that a transform of two dimensions leaves. linear: (3, 3) Returns: (3,)"""
    return np.asarray(np.linalg.svd(linear)[0][:, 2])
