"""Tangents of normals, and angles around normals."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]


def unit(v: Shaped[F32, "n 3"], fallback: Shaped[F32, "#n 3"]) -> Shaped[F32, "n 3"]:
    """Normalize vectors; zero vectors are replaced by the fallback."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.where(length > 1e-12, v / np.maximum(length, 1e-12), fallback).astype(np.float32)


def any_tangent(normal: Shaped[F32, "n 3"]) -> Shaped[F32, "n 3"]:
    """Choose a unit vector orthogonal to each normal (Duff 2017)."""
    x, y, z = normal.T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    return np.stack([1.0 + sign * x * x * a, sign * x * y * a, -sign * x], axis=-1).astype(np.float32)


def project_to_tangent(vector: Shaped[F32, "#n 3"], normal: Shaped[F32, "n 3"]) -> Shaped[F32, "n 3"]:
    """Project vectors to the tangent planes of normals and normalize; zero becomes any tangent."""
    tangential = vector - np.sum(vector * normal, axis=-1, keepdims=True) * normal
    return unit(tangential, any_tangent(normal))


def rotation_between(
    normal: Shaped[F32, "n 3"], start: Shaped[F32, "n 3"], end: Shaped[F32, "n 3"]
) -> Shaped[F32, " n"]:
    """Angles about each `normal` from `start` to `end`, both approximately orthogonal to it, radians in [−π, π]."""
    y, x = np.einsum("nc,nc->n", np.cross(normal, start), end), np.einsum("nc,nc->n", start, end)
    return np.asarray(np.arctan2(y, x), np.float32)
