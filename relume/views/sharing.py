"""What gather rays bring to a view sample is shared with its neighbours in the picture.

A few hundred rays a sample leave grain as fine as the pixels, and light between surfaces hardly changes from one to the
next: a weighted mean over the eight pixels around, of samples on the same smooth piece of the same material, is nearer
to the truth than the sample alone. The weights depend on places and normals only, so that the mean is linear in light
and materials, and one for images and for operators.

What a highlight shows turns by twice as much as the normal: its neighbours are those that are turned alike
(docs/adr/0072-gather-rays-of-stills.md).
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.points import Points
from relume.sharing import Sharing, Weights
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

_MIN_COS_TURN = 0.985  # normals that differ by more than 10° are of another piece
_MIN_COS_TURN_OF_HIGHLIGHTS = 0.9986  # 3°
_MAX_RISE = 0.2  # off the tangent plane, over the distance


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _most_neighbours(first, pixel, width):  # type: ignore[no-untyped-def]
    """Count the samples of the pixels around all samples. first: where each pixel's samples begin. (pixels + 1,)"""
    height, count = (first.shape[0] - 1) // width, 0
    for p in pixel:
        x, y = p % width, p // width
        for row in range(max(y - 1, 0), min(y + 2, height)):
            begin, end = row * width + max(x - 1, 0), row * width + min(x + 2, width)
            count += first[end] - first[begin]
    return count


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _weigh(  # type: ignore[no-untyped-def]
    order, first, pixel, width, position, normal, chance, min_cos_turn, starts, among, weights
):
    """Weigh samples for each other.

    Args:
        order, first: samples of pixel p are order[first[p] : first[p + 1]]. pixel: of each sample. (n,) int64
        position, normal: of each. (n, 3) float32. chance: of the rays of each, or of all; those of one share.
        min_cos_turn: of the normals of neighbours.
        starts, among, weights: written, compressed rows. (n + 1,), (≥ entries,) each
    Returns:
        How many entries there are.
    """
    height, count, num_chances = (first.shape[0] - 1) // width, 0, chance.shape[0]
    for a in range(pixel.shape[0]):
        starts[a], total = count, 0.0
        x, y = pixel[a] % width, pixel[a] // width
        for row in range(max(y - 1, 0), min(y + 2, height)):
            for column in range(max(x - 1, 0), min(x + 2, width)):
                begin, end = first[row * width + column], first[row * width + column + 1]
                for at in range(begin, end):
                    b, turn, rise, squared = order[at], 0.0, 0.0, 0.0
                    for axis in range(3):
                        away = np.float64(position[b, axis]) - np.float64(position[a, axis])
                        turn += np.float64(normal[a, axis]) * np.float64(normal[b, axis])
                        rise += np.float64(normal[a, axis]) * away
                        squared += away * away
                    is_smooth = turn > min_cos_turn and rise * rise <= _MAX_RISE * _MAX_RISE * squared
                    if a == b or (is_smooth and chance[a % num_chances] == chance[b % num_chances]):
                        # a tent; samples of one pixel count as one
                        weight = (2 - abs(row - y)) * (2 - abs(column - x)) / (end - begin)
                        among[count], weights[count] = b, weight
                        total += weight
                        count += 1
        for at in range(starts[a], count):
            weights[at] /= total
    starts[pixel.shape[0]] = count
    return count


def sharing(pixel: NDArray[np.uint32], width: int, points: Points, tents: int = 1) -> Sharing:
    """Weigh a material's samples for each other; rows sum to one.

    Args:
        pixel: y · width + x of each. (n,) uint32. width: of the picture, pixels.
        points: where each is.
        tents: how often what is scattered evenly is shared, one tent after another.
    Cost: O(n) time.
    """
    own, num_pixels = pixel.astype(np.int64), (int(pixel.max(initial=0)) // width + 1) * width
    order = np.argsort(own, kind="stable").astype(np.int32)
    first = np.concatenate([[0], np.cumsum(np.bincount(own, minlength=num_pixels))])
    most, of_points = _most_neighbours(first, own, width), (points.position, points.normal, points.chance)

    def weights(min_cos_turn: float) -> csr_array:
        starts, among = np.empty(len(own) + 1, np.int32), np.empty(most, np.int32)
        found = np.empty(most, np.float32)
        num = _weigh(order, first, own, width, *of_points, min_cos_turn, starts, among, found)
        return csr_array((found[:num].copy(), among[:num].copy(), starts), shape=(len(own), len(own)))

    return Sharing(Weights(weights(_MIN_COS_TURN), tents), Weights(weights(_MIN_COS_TURN_OF_HIGHLIGHTS), 1))
