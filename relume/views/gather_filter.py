"""Filter gathered light over neighboring view samples in the image.

A few hundred rays per sample leave noise at pixel frequency, but indirect light hardly changes between pixels: a
weighted mean over the 3 × 3 pixels, of samples on the same smooth part of the same material, has less error. The
weights depend only on positions and normals, so that the mean is linear in lights and materials, for images and
operators alike.

A mirror reflection turns by twice the change of the normal, so highlights are averaged only over samples with more
similar normals (docs/indirect-light.md#measured).
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.core.numba_options import NO_REFCOUNT
from relume.patches.neighbor_filter import FilterWeights, NeighborFilter
from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]

_MIN_NORMAL_COSINE = 0.985  # 10°: larger differences separate smooth parts
_MIN_HIGHLIGHT_NORMAL_COSINE = 0.9986  # 3°
_MAX_RISE = 0.2  # distance of a neighbor from the tangent plane, over its distance from the sample


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _max_entries(first, pixel, width):  # type: ignore[no-untyped-def]
    """Upper bound on the filter entries: samples in the 3 × 3 pixels around each sample, summed.

    Args:
        first: first sample of each pixel, then their number. (pixels + 1,)
    """
    height, count = (first.shape[0] - 1) // width, 0
    for p in pixel:
        x, y = p % width, p // width
        for row in range(max(y - 1, 0), min(y + 2, height)):
            run_start, run_stop = row * width + max(x - 1, 0), row * width + min(x + 2, width)
            count += first[run_stop] - first[run_start]
    return count


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _fill_weights(  # type: ignore[no-untyped-def]
    order, first, pixel, width, position, normal, alpha_sample, min_normal_cosine, starts, column_index, weights
):
    """Compute filter weights between samples.

    Args:
        order, first: samples of pixel p are order[first[p] : first[p + 1]].
        pixel: pixel index of each sample. (n,) int64
        position, normal: position and normal of each sample. (n, 3) float32
        alpha_sample: alpha sample of each, or one for all; only samples with equal values are averaged.
        min_normal_cosine: least cosine between the normals of neighbors that are averaged.
        starts, column_index, weights: rows of the sparse matrix, written. (n + 1,), (≥ entries,) each
    Returns:
        Number of entries.
    """
    height, count, num_alpha_samples = (first.shape[0] - 1) // width, 0, alpha_sample.shape[0]
    for a in range(pixel.shape[0]):
        starts[a], total = count, 0.0
        x, y = pixel[a] % width, pixel[a] // width
        for row in range(max(y - 1, 0), min(y + 2, height)):
            for column in range(max(x - 1, 0), min(x + 2, width)):
                run_start, run_stop = first[row * width + column], first[row * width + column + 1]
                for entry in range(run_start, run_stop):
                    b, normal_cosine, rise, squared = order[entry], 0.0, 0.0, 0.0
                    for axis in range(3):
                        offset = np.float64(position[b, axis]) - np.float64(position[a, axis])
                        normal_cosine += np.float64(normal[a, axis]) * np.float64(normal[b, axis])
                        rise += np.float64(normal[a, axis]) * offset
                        squared += offset * offset
                    is_smooth = normal_cosine > min_normal_cosine and rise * rise <= _MAX_RISE * _MAX_RISE * squared
                    if a == b or (
                        is_smooth and alpha_sample[a % num_alpha_samples] == alpha_sample[b % num_alpha_samples]
                    ):
                        # a tent filter; the samples of one pixel share its weight
                        weight = (2 - abs(row - y)) * (2 - abs(column - x)) / (run_stop - run_start)
                        column_index[count], weights[count] = b, weight
                        total += weight
                        count += 1
        for entry in range(starts[a], count):
            weights[entry] /= total
    starts[pixel.shape[0]] = count
    return count


def make_neighbor_filter(
    pixel: Shaped[NDArray[np.uint32], " n"], width: int, points: SurfacePoints, num_passes: int = 1
) -> NeighborFilter:
    """Make the filter of a material's samples in O(n) time; its rows sum to one.

    Args:
        pixel: y · width + x of each sample. width: width of the image, pixels.
        points: points of the samples.
        num_passes: number of tent filter passes for diffuse light.
    """
    pixel_index, num_pixels = pixel.astype(np.int64), (int(pixel.max(initial=0)) // width + 1) * width
    order = np.argsort(pixel_index, kind="stable").astype(np.int32)
    first = np.concatenate([[0], np.cumsum(np.bincount(pixel_index, minlength=num_pixels))])
    max_entries, point_arrays = (
        _max_entries(first, pixel_index, width),
        (points.position, points.normal, points.alpha_sample),
    )

    def build_weights(min_normal_cosine: float) -> csr_array:
        starts, column_index = np.empty(len(pixel_index) + 1, np.int32), np.empty(max_entries, np.int32)
        values = np.empty(max_entries, np.float32)
        num_entries = _fill_weights(
            order, first, pixel_index, width, *point_arrays, min_normal_cosine, starts, column_index, values
        )
        return csr_array(
            (values[:num_entries].copy(), column_index[:num_entries].copy(), starts),
            shape=(len(pixel_index), len(pixel_index)),
        )

    return NeighborFilter(
        FilterWeights(build_weights(_MIN_NORMAL_COSINE), num_passes),
        FilterWeights(build_weights(_MIN_HIGHLIGHT_NORMAL_COSINE), 1),
    )
