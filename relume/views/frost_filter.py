"""Filter of what frosted glass shows: each pixel averages the rays of its neighbors, whose facets differ.

A pixel has few rays through frosted glass, at most 16, but 4 × 4 pixels have 256 that are stratified together. The
filter is a box of 4 × 4 after one of 2 × 2, so every ray of the 256 has the same weight in every pixel. Only pixels
that show the same glass are averaged, and the coverage of the glass stays that of the pixel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array

F32 = NDArray[np.float32]

REACH = 2  # pixels to each side
RAY_SPACING = 0.2  # angle between the 256 rays, radians over the width α of the facets; less than that of the lobe
MAX_FROSTED_RATIO = 8.0  # radiance of the environment over its mean; the excess is a bright light
GLOW_WIDTH = 2.0  # of bright lights, radians over α
_WEIGHTS = 1.0, 2.0, 2.0, 2.0, 1.0  # along each axis


class FrostFilter(NamedTuple):
    """The samples behind frosted glass, and a filter of their sums.

    Attributes:
        pixel: pixels with such samples, ascending. entry: of these samples in `View.order`.
        first: first of each pixel's entries, and their number at the end.
        change: from sums of these pixels to what the filter adds to them: filter minus identity.
    """

    pixel: Shaped[NDArray[np.int64], " p"]
    entry: Shaped[NDArray[np.int64], " e"]
    first: Shaped[NDArray[np.int32], " p_and_end"]
    change: csr_array


def make_frost_filter(
    frost: Shaped[NDArray[np.uint16], " n"],
    material: Shaped[NDArray[np.uint16], " n"],
    pixel: Shaped[NDArray[np.uint32], " n"],
    weight: Shaped[F32, " n"],
    order: Shaped[NDArray[np.int32], " n"],
    width: int,
) -> FrostFilter | None:
    """Make the filter of a view; None if no sample is behind frosted glass.

    Args:
        frost, material, pixel, weight: of the samples, see `relume.camera.view_samples.ViewSamples`.
        order: samples by pixel. width: width of the image.
    """
    entry = np.flatnonzero(frost[order])
    if not len(entry):
        return None
    sample_pixel = pixel[order[entry]].astype(np.int64)
    pixels, row, counts = np.unique(sample_pixel, return_inverse=True, return_counts=True)
    glass = np.zeros(len(pixels), np.uint16)
    glass[row] = frost[order[entry]]
    index = np.full(int(pixels[-1]) + 1, -1, np.int64)
    index[pixels] = np.arange(len(pixels))
    coverage = _coverage(frost, material, pixel, weight, index, glass)
    y, x = np.divmod(pixels, width)
    rows, columns, values = [], [], []
    for dy in range(-REACH, REACH + 1):
        for dx in range(-REACH, REACH + 1):
            target = (y + dy) * width + x + dx
            is_inside = (x + dx >= 0) & (x + dx < width) & (target >= 0) & (target < len(index))
            neighbor = np.where(is_inside, index[np.where(is_inside, target, 0)], -1)
            is_same = (neighbor >= 0) & (glass[neighbor] == glass)
            rows.append(np.flatnonzero(is_same))
            columns.append(neighbor[is_same])
            values.append(np.full(len(rows[-1]), _WEIGHTS[REACH + dx] * _WEIGHTS[REACH + dy]))
    shape = len(pixels), len(pixels)
    box = csr_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
    scale = coverage / np.maximum(box @ coverage, 1e-12)
    change = csr_array(box.multiply(scale[:, None])) - eye_array(len(pixels), format="csr")
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return FrostFilter(pixels, entry, first, csr_array(change, dtype=np.float32))


def _coverage(
    frost: NDArray[np.uint16],
    material: NDArray[np.uint16],
    pixel: NDArray[np.uint32],
    weight: F32,
    index: NDArray[np.int64],
    glass: NDArray[np.uint16],
) -> Shaped[NDArray[np.float64], " p"]:
    """Fraction of each pixel that its frosted glass covers: the weight of the samples on its front.

    Args:
        frost, material, pixel, weight: as in `make_frost_filter`. index: row of each pixel, −1 for none.
        glass: 1 + index of the material of each row.
    """
    front = np.flatnonzero((frost == 0) & (pixel < len(index)))
    front = front[index[pixel[front]] >= 0]
    row = index[pixel[front]]
    is_front = material[front] + 1 == glass[row]
    coverage = np.bincount(row[is_front], weight[front][is_front], len(glass)).astype(np.float64)
    # of glass behind other glass, only what it shows is stored
    behind = np.flatnonzero((frost > 0) & (pixel < len(index)))
    shown = np.bincount(index[pixel[behind]], weight[behind], len(glass)).astype(np.float64)
    return np.where(coverage > 0, coverage, shown)
