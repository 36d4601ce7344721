"""Changes of normal and view direction within a sample's part of its pixel, from its neighbors in the image.

A polished surface reflects many directions within one pixel where it is curved: its highlights are averaged over them.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]

_MIN_NORMAL_COSINE = 0.77  # 40°: larger differences are edges
_MAX_RISE = 0.5  # distance of a neighbor from the tangent plane, over its distance from the sample


def pixel_footprint(
    pixel: Shaped[NDArray[np.integer], " n"], width: int, points: SurfacePoints, wo: Shaped[F32, "n 3"]
) -> Shaped[F32, "n 2 2 3"]:
    """Return the change of normals and of view directions along the two sides of each sample's part of its pixel.

    Args:
        pixel: of each sample of one material. width: of the image, pixels.
        points: the samples. wo: their view directions.
    Returns:
        For each sample normal and wo, the changes to the right and downward; zero where neighbors are no continuation.
    """
    pixel = pixel.astype(np.int64)
    first = np.full(int(pixel.max(initial=0)) + width + 2, -1, np.int64)
    first[pixel[::-1]] = np.arange(len(pixel))[::-1]
    count = np.bincount(pixel, minlength=len(first))
    out = np.zeros((len(pixel), 2, 2, 3), np.float32)
    for axis, step in enumerate((1, width)):
        is_inside = [pixel % width < width - 1, pixel % width > 0] if axis == 0 else [pixel >= 0, pixel >= width]
        total = np.zeros((len(pixel), 2, 3))
        num = np.zeros(len(pixel))
        for sign, inside in zip((1, -1), is_inside, strict=True):
            neighbor = np.where(inside, first[np.where(inside, pixel + sign * step, 0)], -1)
            rows = np.flatnonzero(neighbor >= 0)
            rows = rows[_continues(points, rows, neighbor[rows])]
            change = [points.normal[neighbor[rows]] - points.normal[rows], wo[neighbor[rows]] - wo[rows]]
            total[rows] += sign * np.stack(change, axis=1)
            num[rows] += 1
        out[:, :, axis] = total / np.maximum(num, 1)[:, None, None]
    return np.asarray(out / np.sqrt(np.maximum(count[pixel], 1))[:, None, None, None], np.float32)


def _continues(
    points: SurfacePoints, rows: NDArray[np.intp], neighbor: NDArray[np.integer]
) -> Shaped[NDArray[np.bool_], " m"]:
    """Return whether a neighbor lies on the same smooth surface as a sample."""
    normal, offset = points.normal[rows], points.position[neighbor] - points.position[rows]
    cosine = np.einsum("nc,nc->n", normal, points.normal[neighbor])
    rise = np.abs(np.einsum("nc,nc->n", normal, offset))
    return np.asarray((cosine > _MIN_NORMAL_COSINE) & (rise <= _MAX_RISE * np.linalg.norm(offset, axis=1)))
