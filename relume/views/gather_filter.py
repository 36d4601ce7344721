"""Filter gathered light over neighboring view samples in the image.

A few hundred rays per sample leave noise at pixel frequency, but indirect light hardly changes between pixels: a
weighted mean over the pixels around a sample, of samples on the same smooth part of the same material, has less error.
The weights depend only on geometry, so that the mean is linear in lights and materials, for images and operators alike.

Irradiance changes between points a and b by a share of at most about

    ε(a, b) = ‖x_a − x_b‖ / R + √(2 − 2 n_a · n_b) ,

where R is the harmonic mean of the distances to the surfaces around them (irradiance caching: Ward, Rubinstein and
Clear, "A Ray Tracing Solution for Diffuse Interreflection", 1988). A neighbor has the weight of a tent over pixels
times 1 − ε / ε_max: means are narrow at contacts and where a surface bends, and wide elsewhere. A mirror reflection
turns by twice the change of the normal, so highlights have a smaller ε_max (docs/indirect-light.md#measured).
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.core.numba_options import NO_REFCOUNT
from relume.patches.neighbor_filter import NeighborFilter
from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]

_RADIUS = 2  # pixels
_MAX_CHANGE, _MAX_HIGHLIGHT_CHANGE = 0.2, 0.05  # ε_max
_MAX_RISE = np.float32(0.2)  # distance of a neighbor from the tangent plane, over its distance from the sample

_ZERO, _ONE, _TWO = np.float32(0), np.float32(1), np.float32(2)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _max_entries(first, pixel, width):  # type: ignore[no-untyped-def]
    """Upper bound on the filter entries: samples in the pixels around each sample, summed.

    Args:
        first: first sample of each pixel, then their number. (pixels + 1,)
    """
    height, count = (first.shape[0] - 1) // width, 0
    for p in pixel:
        x, y = p % width, p // width
        for row in range(max(y - _RADIUS, 0), min(y + _RADIUS + 1, height)):
            run_start, run_stop = row * width + max(x - _RADIUS, 0), row * width + min(x + _RADIUS + 1, width)
            count += first[run_stop] - first[run_start]
    return count


@nb.njit(nogil=True, cache=True, fastmath=True, inline="always")
def _change(points, inverse_distance, a, b):  # type: ignore[no-untyped-def]
    """Return ε of two samples; 2 if they lie on different smooth surfaces.

    Args:
        points: position and normal of each sample, (n, 3) float32, and their alpha samples.
    """
    position, normal, alpha_sample = points
    rise = squared = turn = _ZERO
    for axis in range(3):
        offset, bend = position[b, axis] - position[a, axis], normal[b, axis] - normal[a, axis]
        rise += normal[a, axis] * offset
        squared += offset * offset
        turn += bend * bend
    num = alpha_sample.shape[0]
    if rise * rise > _MAX_RISE * _MAX_RISE * squared or alpha_sample[a % num] != alpha_sample[b % num]:
        return _TWO
    return math.sqrt(squared) * max(inverse_distance[a], inverse_distance[b]) + math.sqrt(turn)


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _fill_weights(order, first, pixel, width, points, inverse_distance, max_change, starts, column_index, weights):  # type: ignore[no-untyped-def]
    """Compute filter weights between samples.

    Args:
        order, first: samples of pixel p are order[first[p] : first[p + 1]].
        pixel: pixel index of each sample. (n,) int64. width: of the image, pixels.
        points, inverse_distance: as in `_change`. max_change: ε_max.
        starts, column_index, weights: rows of the sparse matrix, written. (n + 1,), (≥ entries,) each
    Returns:
        Number of entries.
    """
    height, count = (first.shape[0] - 1) // width, 0
    for a in range(pixel.shape[0]):
        starts[a], total = count, _ZERO
        x, y = pixel[a] % width, pixel[a] // width
        for row in range(max(y - _RADIUS, 0), min(y + _RADIUS + 1, height)):
            for column in range(max(x - _RADIUS, 0), min(x + _RADIUS + 1, width)):
                run_start, run_stop = first[row * width + column], first[row * width + column + 1]
                tent = np.float32((_RADIUS + 1 - abs(row - y)) * (_RADIUS + 1 - abs(column - x)))
                for entry in range(run_start, run_stop):
                    b = order[entry]
                    closeness = _ONE if a == b else _ONE - _change(points, inverse_distance, a, b) / max_change
                    if closeness > 0:
                        # the samples of one pixel share its weight
                        column_index[count], weights[count] = b, closeness * tent / np.float32(run_stop - run_start)
                        total += weights[count]
                        count += 1
        for entry in range(starts[a], count):
            weights[entry] /= total
    starts[pixel.shape[0]] = count
    return count


def make_neighbor_filter(
    pixel: Shaped[NDArray[np.uint32], " n"], width: int, points: SurfacePoints, inverse_distance: Shaped[F32, " n"]
) -> NeighborFilter:
    """Make the filter of a material's samples in O(n) time; its rows sum to one.

    Args:
        pixel: y · width + x of each sample. width: width of the image, pixels.
        points: points of the samples. inverse_distance: see `NeighborFilter`.
    """
    pixel_index, num_pixels = pixel.astype(np.int64), (int(pixel.max(initial=0)) // width + 1) * width
    order = np.argsort(pixel_index, kind="stable").astype(np.int32)
    first = np.concatenate([[0], np.cumsum(np.bincount(pixel_index, minlength=num_pixels))])
    point_arrays = points.position, points.normal, points.alpha_sample
    max_entries = _max_entries(first, pixel_index, width)

    def build_weights(max_change: float) -> csr_array:
        starts, column_index = np.empty(len(pixel_index) + 1, np.int32), np.empty(max_entries, np.int32)
        values = np.empty(max_entries, np.float32)
        sample_args = order, first, pixel_index, width, point_arrays, inverse_distance
        num_entries = _fill_weights(*sample_args, np.float32(max_change), starts, column_index, values)
        return csr_array(
            (values[:num_entries].copy(), column_index[:num_entries].copy(), starts),
            shape=(len(pixel_index), len(pixel_index)),
        )

    return NeighborFilter(build_weights(_MAX_CHANGE), build_weights(_MAX_HIGHLIGHT_CHANGE), inverse_distance)
