"""Axes of a light: the direction that it faces, and the two that its rotation is measured from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F64 = NDArray[np.float64]

_PARALLEL_TOLERANCE = 1e-6


def unit_direction(direction: Sequence[float]) -> Shaped[F64, " 3"]:
    """Normalize a direction of a look, whose components may be tiny."""
    vector = np.array(direction, np.float64)
    vector /= np.abs(vector).max()  # first, so that squares of tiny numbers do not underflow
    return np.asarray(vector / np.linalg.norm(vector))


def light_axes(direction: Sequence[float], rotation: float = 0.0) -> Shaped[F64, "3 3"]:
    """Return the horizontal and upright axis of a light and its direction, as rows; right-handed.

    Args:
        direction: of any length above zero. Upright is in its plane with +Y, or +Z if it is vertical.
        rotation: of both axes about the direction, degrees.
    """
    facing = unit_direction(direction)
    up_hint = np.array([0.0, 1.0, 0.0]) if abs(facing[1]) < 1 - _PARALLEL_TOLERANCE else np.array([0.0, 0.0, 1.0])
    up = up_hint - (up_hint @ facing) * facing
    up /= np.linalg.norm(up)
    horizontal = np.cross(up, facing)
    cosine, sine = np.cos(np.radians(rotation)), np.sin(np.radians(rotation))
    return np.stack([cosine * horizontal + sine * up, cosine * up - sine * horizontal, facing])
