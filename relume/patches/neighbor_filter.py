"""Share gathered light among neighboring view samples of the image.

A few hundred rays per sample leave noise at pixel frequency, but indirect light hardly changes between pixels: a
weighted mean over the pixels around a sample, of samples on the same smooth part of the same material, has less error.
The weights depend only on geometry, so that the mean is linear in lights and materials, for images and operators alike.

Irradiance changes between points a and b by a share of at most about

    ε(a, b) = ‖x_a − x_b‖ / R + s √(2 − 2 n_a · n_b) ,   s = 1 ,

where R is the harmonic mean of the distances to the surfaces around them (irradiance caching: Ward, Rubinstein and
Clear, "A Ray Tracing Solution for Diffuse Interreflection", 1988). A neighbor has the weight of a tent over pixels
times 1 − ε / ε_max: means are narrow at contacts and where a surface bends, and wide elsewhere. A mirror reflection
turns by twice the change of the normal, and highlights are narrow: for them s = 4
(docs/adr/0036-interleaved-gather-rays.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.brdf.term import Term
from relume.core.numba_options import NO_REFCOUNT
from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]

_RADIUS = 2  # pixels
_MAX_CHANGE = np.float32(0.2)  # ε_max
_DIFFUSE_TURN, _HIGHLIGHT_TURN = np.float32(1), np.float32(4)  # s
_MAX_RISE = np.float32(0.2)  # distance of a neighbor from the tangent plane, over its distance from the sample

_ZERO, _ONE, _TWO = np.float32(0), np.float32(1), np.float32(2)


@dataclass(frozen=True)
class NeighborFilter:
    """Weights among n samples of a material, computed where they are needed: all of them take much memory.

    Attributes:
        width: of the image, pixels. pixel: y · width + x of each sample.
        order, first: samples of pixel p are order[first[p] : first[p + 1]].
        points: of the samples. inverse_distance: mean of 1 / distance over the rays of each, 1 / scene unit.
        has_highlight: samples that share their highlights.
    """

    width: int
    pixel: Shaped[I32, " n"]
    order: Shaped[I32, " n"]
    first: Shaped[I32, " pixels_and_end"]
    points: SurfacePoints
    inverse_distance: Shaped[F32, " n"]
    has_highlight: Shaped[NDArray[np.bool_], " n"]

    @classmethod
    def of_samples(
        cls, pixel: Shaped[NDArray[np.uint32], " n"], width: int, points: SurfacePoints, inverse_distance: F32
    ) -> Self:
        """Make the filter of a material's samples.

        Args:
            pixel, width, points, inverse_distance: see the attributes.
        """
        num_pixels = (int(pixel.max(initial=0)) // width + 1) * width
        order = np.argsort(pixel, kind="stable").astype(np.int32)
        first = np.concatenate([[0], np.cumsum(np.bincount(pixel, minlength=num_pixels))]).astype(np.int32)
        has_highlight = np.ones(len(pixel), np.bool_)
        return cls(width, pixel.astype(np.int32), order, first, points, inverse_distance, has_highlight)

    def among_highlights(self, has_highlight: Shaped[NDArray[np.bool_], " n"]) -> Self:
        """Return the filter with highlights shared among some samples alone; those of all others become zero."""
        return replace(self, has_highlight=has_highlight)

    def weights(self, term: Term, start: int, stop: int) -> csr_array:
        """Return the weights of samples [start, stop) for a term in O(samples) time; rows sum to one. (m, n)

        Args:
            term: a diffuse one, or one with a highlight. start, stop: the samples.
        """
        pixels = self.order, self.first, self.pixel, self.width
        max_entries = _max_entries(self.first, self.pixel[start:stop], self.width)
        starts, columns = np.empty(stop - start + 1, np.int32), np.empty(max_entries, np.int32)
        values, is_diffuse = np.empty(max_entries, np.float32), term.scatters_diffusely
        points = self.points.position, self.points.normal, self.points.alpha_sample
        member = np.ones(1, np.bool_) if is_diffuse else self.has_highlight
        turn = _DIFFUSE_TURN if is_diffuse else _HIGHLIGHT_TURN
        args = pixels, points, self.inverse_distance, member, turn, start, stop
        num = _fill_weights(*args, starts, columns, values)
        return csr_array((values[:num], columns[:num], starts), shape=(stop - start, len(self.pixel)))

    def weights_and_neighbors(
        self, term: Term, start: int, stop: int
    ) -> tuple[csr_array, Shaped[NDArray[np.intp], " k"]]:
        """Return the weights of samples [start, stop) among the neighbors that they have, (m, k), and these.

        Args:
            term, start, stop: as in `weights`.
        """
        weights = self.weights(term, start, stop)
        first = weights.indices.min(initial=weights.shape[1])
        is_neighbor = np.zeros(weights.indices.max(initial=first - 1) + 1 - first, np.bool_)
        is_neighbor[weights.indices - first] = True
        column, neighbors = np.cumsum(is_neighbor, dtype=np.int32) - 1, first + np.flatnonzero(is_neighbor)
        shape = stop - start, len(neighbors)
        return csr_array((weights.data, column[weights.indices - first], weights.indptr), shape=shape), neighbors


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
def _change(points, inverse_distance, turn, a, b):  # type: ignore[no-untyped-def]
    """Return ε of two samples; 2 if they lie on different smooth surfaces.

    Args:
        points: position and normal of each sample, (n, 3) float32, and their alpha samples. turn: s
    """
    position, normal, alpha_sample = points
    rise = squared = bent = _ZERO
    for axis in range(3):
        offset, bend = position[b, axis] - position[a, axis], normal[b, axis] - normal[a, axis]
        rise += normal[a, axis] * offset
        squared += offset * offset
        bent += bend * bend
    num = alpha_sample.shape[0]
    if rise * rise > _MAX_RISE * _MAX_RISE * squared or alpha_sample[a % num] != alpha_sample[b % num]:
        return _TWO
    return math.sqrt(squared) * max(inverse_distance[a], inverse_distance[b]) + turn * math.sqrt(bent)


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _fill_weights(pixels, points, inverse_distance, member, turn, start, stop, starts, column_index, weights):  # type: ignore[no-untyped-def]
    """Compute the weights of samples [start, stop).

    Args:
        pixels: order, first, pixel and width of `NeighborFilter`. points, inverse_distance, turn: as in `_change`.
        member: samples that share their light, or one for all.
        starts, column_index, weights: rows of the sparse matrix, written. (m + 1,), (≥ entries,) each
    Returns:
        Number of entries.
    """
    order, first, pixel, width = pixels
    height, count, num_members = (first.shape[0] - 1) // width, 0, member.shape[0]
    for a in range(start, stop):
        starts[a - start], total = count, _ZERO
        x, y = pixel[a] % width, pixel[a] // width
        if not member[a % num_members]:
            continue
        for row in range(max(y - _RADIUS, 0), min(y + _RADIUS + 1, height)):
            for column in range(max(x - _RADIUS, 0), min(x + _RADIUS + 1, width)):
                run_start, run_stop = first[row * width + column], first[row * width + column + 1]
                tent = np.float32((_RADIUS + 1 - abs(row - y)) * (_RADIUS + 1 - abs(column - x)))
                for entry in range(run_start, run_stop):
                    b = order[entry]
                    closeness = _ONE if a == b else _ONE - _change(points, inverse_distance, turn, a, b) / _MAX_CHANGE
                    if closeness > 0 and member[b % num_members]:
                        # the samples of one pixel share its weight
                        column_index[count], weights[count] = b, closeness * tent / np.float32(run_stop - run_start)
                        total += weights[count]
                        count += 1
        for entry in range(starts[a - start], count):
            weights[entry] /= total
    starts[stop - start] = count
    return count
