"""Transforms of texture coordinates in node graphs: affine maps with v from the bottom."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.math.uv_transform import UvTransform
from relume.scene_io.surfaces.uv_transforms import UvSet

F64 = NDArray[np.float64]
Pair = tuple[float, float]
ZERO: Pair = (0.0, 0.0)
ONE: Pair = (1.0, 1.0)


@dataclass(frozen=True)
class Placement:
    """Texture coordinates u′ = M u + c of the set `uv_set`."""

    uv_set: UvSet = "st"
    matrix: Shaped[F64, "2 2"] = field(default_factory=lambda: np.eye(2))
    offset: Shaped[F64, " 2"] = field(default_factory=lambda: np.zeros(2))

    def then(self, scale: Pair, offset: Pair, degrees: float = 0.0) -> Placement:
        """Apply R S u + c afterwards.

        Args:
            scale: S. offset: c. degrees: of R, counterclockwise.
        """
        matrix = _rotation(degrees) * np.array(scale)
        return Placement(self.uv_set, matrix @ self.matrix, matrix @ self.offset + np.array(offset))

    def place2d(self, pivot: Pair, scale: Pair, offset: Pair, degrees: float, *, offset_first: bool) -> Placement:
        """Apply the node `place2d`: R (u − p) / s − o + p, or R (u − p − o) / s + p, with R before the division.

        Args:
            pivot, scale, offset: p, s and o. degrees: of R, clockwise. offset_first: the second of these.
        """
        p, o = np.array(pivot), np.array(offset)
        inverse = 1 / sx if (sx := scale[0]) else 1.0, 1 / sy if (sy := scale[1]) else 1.0
        if offset_first:
            moved = self.then(ONE, _pair(-p - o)).then(ONE, ZERO, -degrees)
            return moved.then(inverse, pivot)
        return self.then(ONE, _pair(-p)).then(inverse, _pair(p - o), -degrees)

    def uv_transform(self) -> UvTransform | None:
        """The transform with v from the top; None if it shears, which glTF has no transform for."""
        (a, b), (c, d) = self.matrix.tolist()
        u, v = self.offset.tolist()
        flipped = u + b, 1 - v - d
        if b == c == 0:
            return UvTransform(scale=(a, d), offset=flipped)
        cosine, sine = np.array([a, c]) / max(np.hypot(a, c), 1e-300)
        if abs(cosine * b + sine * d) > 1e-6 * max(abs(b), abs(d)):
            return None
        scale = float(np.hypot(a, c)), float(cosine * d - sine * b)
        return UvTransform(scale=scale, offset=flipped, rotation=float(np.arctan2(sine, cosine)))


def _rotation(degrees: float) -> F64:
    if degrees == 0:
        return np.eye(2)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s], [s, c]])


def _pair(values: F64) -> Pair:
    return float(values[0]), float(values[1])
