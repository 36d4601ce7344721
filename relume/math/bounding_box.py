"""Axis-aligned bounding boxes."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Real = TypeVar("Real", bound=np.floating)


def bounding_box(points: NDArray[Real]) -> tuple[NDArray[Real], NDArray[Real]]:
    """Return the lowest and the highest coordinates of at least one point, (3,) each, of points (n, 3).

    By columns: NumPy takes three times as long to reduce rows of three along the first axis.
    """
    low, high = (np.array([reduce(column) for column in points.T], points.dtype) for reduce in (np.min, np.max))
    return low, high


def box_corners(points: NDArray[Real]) -> NDArray[Real]:
    """Return the corners, (8, 3), of the bounding box of at least one point (n, 3)."""
    low, high = bounding_box(points)
    return np.asarray(np.where(np.indices((2, 2, 2)).reshape(3, -1).T == 0, low, high), points.dtype)
