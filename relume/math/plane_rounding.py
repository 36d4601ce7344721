"""Rounding of float32 at triangles: how far off its plane a ray must start or end.

Let ε = 2⁻²⁴, n the unit normal of a triangle with edges e₁, e₂ and a box of size s, and m the largest |coordinate| of
its corners along each axis. Embree finds the side of the plane on which an origin o lies by the sign of a determinant,
det(e₁, e₂, v − o). It is moved by the rounding of corners and origins, ε Σ |nᵢ| mᵢ, and by that of the determinant,
ε perm(|e₁|, |e₂|, s) / |e₁ × e₂| (Shewchuk 1997). The offset

    h = ε (4 Σ |nᵢ| mᵢ + 2 perm(|e₁|, |e₂|, s) / |e₁ × e₂| + max s)

exceeds both, so that no ray that leaves the plane meets its triangle. It grows with the triangle and its distance from
the world's origin, and not with the scene. In a plane x, y or z = 0 only the last summand remains.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

ROUNDING = 2.0**-24  # of float32
_POSITIONS, _DETERMINANT, _EXTENT = 4.0, 2.0, 1.0  # factors of the summands; twice those without a false hit
_MAX_ASPECT = 512.0  # of slivers: their offset would exceed their height
_TINY = 1e-300


class _Determinants(NamedTuple):
    """Triangles as determinants: unit normals, extents, and permanents per extent over |e₁ × e₂| along each axis."""

    normal: Shaped[F64, "n 3"]
    extent: Shaped[F64, "n 3"]
    condition: Shaped[F64, "n 3"]

    @classmethod
    def of(cls, corners: Shaped[NDArray[np.floating], "n 3 3"]) -> Self:
        p = corners.astype(np.float64)
        first, second = np.abs(p[:, 1] - p[:, 0]), np.abs(p[:, 2] - p[:, 0])
        normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        length = np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), _TINY)
        permanent = np.roll(first, -1, 1) * np.roll(second, -2, 1) + np.roll(first, -2, 1) * np.roll(second, -1, 1)
        return cls(normal / length, np.ptp(p, axis=1), np.minimum(permanent / length, _MAX_ASPECT))


def origin_offsets(corners: Shaped[NDArray[np.floating], "n 3 3"]) -> Shaped[F32, " n"]:
    """Offsets h of ray origins from the planes of triangles, meters. corners: positions, meters"""
    triangles = _Determinants.of(corners)
    rounding = _POSITIONS * (np.abs(triangles.normal) * np.abs(corners).max(axis=1)).sum(axis=1)
    rounding += _DETERMINANT * (triangles.condition * triangles.extent).sum(axis=1)
    return np.asarray(ROUNDING * (rounding + _EXTENT * triangles.extent.max(axis=1)), np.float32)


def end_offsets(corners: Shaped[NDArray[np.floating], "n 3 3"]) -> Shaped[F32, "n 2"]:
    """Offsets of ray ends from the planes of triangles: h, and what is added per meter of the ray's length.

    From afar, the extent in the determinant's rounding is that of the ray.

    Args:
        corners: positions, meters.
    """
    condition = _Determinants.of(corners).condition.sum(axis=1)
    per_meter = ROUNDING * (_POSITIONS + _DETERMINANT * condition)
    return np.stack([origin_offsets(corners), per_meter], axis=1).astype(np.float32)
