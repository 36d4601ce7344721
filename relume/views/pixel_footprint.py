"""Changes of normal and view direction within a sample's part of its pixel, from its neighbors in the image.

A polished surface reflects many directions within one pixel where it is curved: its highlights are averaged over them.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]

_MIN_NORMAL_COSINE = np.float32(0.77)  # 40°: larger differences are edges
_MAX_RISE = np.float32(0.5)  # distance of a neighbor from the tangent plane, over its distance from the sample


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
    part = (1 / np.sqrt(np.maximum(np.bincount(pixel, minlength=1), 1))).astype(np.float32)
    out = np.empty((len(pixel), 2, 2, 3), np.float32)
    args = pixel, first, width, part, points.position, points.normal, wo
    parallel_for_chunks(lambda start, stop: _fill(*args, start, stop, out), len(pixel))
    return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _fill(pixel, first, width, part, position, normal, wo, start, stop, out):  # type: ignore[no-untyped-def]
    """Write the footprints of samples [start, stop).

    Args:
        pixel, width, wo: as in `pixel_footprint`. first: first sample of each pixel, −1 for none.
        part: side of a sample's part of each pixel. position, normal: of the samples.
    """
    for p in range(start, stop):
        column = pixel[p] % width
        for axis in range(2):
            num, scale = 0, part[pixel[p]]
            for k in range(3):
                out[p, 0, axis, k] = out[p, 1, axis, k] = 0
            for sign in (1, -1):
                other = pixel[p] + (sign if axis == 0 else sign * width)
                is_outside = (column + sign < 0 or column + sign >= width) if axis == 0 else other < 0
                q = np.int64(-1) if is_outside else first[other]
                if q < 0 or not _continues(position[p], normal[p], position[q], normal[q]):
                    continue
                num += 1
                for k in range(3):
                    out[p, 0, axis, k] += np.float32(sign) * scale * (normal[q, k] - normal[p, k])
                    out[p, 1, axis, k] += np.float32(sign) * scale * (wo[q, k] - wo[p, k])
            if num == 2:
                for k in range(3):
                    out[p, 0, axis, k] *= np.float32(0.5)
                    out[p, 1, axis, k] *= np.float32(0.5)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _continues(position, normal, other_position, other_normal):  # type: ignore[no-untyped-def]
    """Return whether a neighbor lies on the same smooth surface as a sample."""
    cosine = rise = squared = np.float32(0)
    for k in range(3):
        offset = other_position[k] - position[k]
        cosine += normal[k] * other_normal[k]
        rise += normal[k] * offset
        squared += offset * offset
    return cosine > _MIN_NORMAL_COSINE and rise * rise <= _MAX_RISE * _MAX_RISE * squared
