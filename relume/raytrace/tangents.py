"""Directions across others: tangents of normals, and turns about them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]


def unit(v: F32, fallback: F32) -> F32:
    """Scale vectors (n, 3) to length one; where they have none, take another."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.where(length > 1e-12, v / np.maximum(length, 1e-12), fallback).astype(np.float32)


def any_tangent(normal: F32) -> F32:
    """Find a unit vector across each normal (n, 3) (Duff 2017). (n, 3) float32"""
    x, y, z = normal.T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    return np.stack([1.0 + sign * x * x * a, sign * x * y * a, -sign * x], axis=-1).astype(np.float32)


def project_to_tangent(vector: F32, normal: F32) -> F32:
    """Take the part of vectors (n, 3) across normals (n, 3), unit; any direction across where there is none."""
    tangential = vector - np.sum(vector * normal, axis=-1, keepdims=True) * normal
    return unit(tangential, any_tangent(normal))


def rotation_between(normal: F32, start: F32, end: F32) -> F32:
    """Find the angles from some vectors to others about normals, radians.

    Args:
        normal: unit. (n, 3) start, end: across these, about. (n, 3) each
    Returns:
        Within [−π, π]. (n,) float32
    """
    y, x = np.einsum("nc,nc->n", np.cross(normal, start), end), np.einsum("nc,nc->n", start, end)
    return np.asarray(np.arctan2(y, x), np.float32)
