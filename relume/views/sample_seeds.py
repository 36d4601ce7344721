"""Seeds of view samples, which shift their patterns of gather rays: interleaved between neighbors.

The shifts of 3 × 3 pixels lie in nine equal parts of a lattice cell. Means over neighboring samples then have as little
noise as one sample with many times the rays (interleaved sampling: Keller and Heidrich 2001).
"""

from __future__ import annotations

from functools import cache

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.raytrace.gather_rays import STEP_U, STEP_V
from relume.store.bake_protocol import StoreReader

_SIDE = 3  # of the square of pixels, and of the subdivided cell
_SEEDS_PER_SUBCELL = 7000  # of 2^16 seeds, a ninth of which lies in each
_MAX_ROWS_BEFORE = 1024  # that are read for a pixel whose samples begin before a task


@cache
def _seeds_by_subcell() -> Shaped[NDArray[np.uint32], "subcells seeds"]:
    """Seeds whose offsets lie in each of 3 × 3 subcells of the unit square, in the order of the sequence."""
    seed = np.arange(1 << 16, dtype=np.uint32)
    row, column = ((_SIDE * (seed * step / 2**32)).astype(np.intp) for step in (STEP_U, STEP_V))
    subcell = _SIDE * row + column
    return np.stack([seed[subcell == k][:_SEEDS_PER_SUBCELL] for k in range(_SIDE * _SIDE)])


def interleaved_seeds(
    pixel: Shaped[NDArray[np.integer], " n"], width: int, first_row: int
) -> Shaped[NDArray[np.uint32], " n"]:
    """Return seeds of samples. Within its subcell, each shift is another one.

    Args:
        pixel: y · width + x of each sample; samples of one pixel follow one another, and have different subcells.
        width: of the image, pixels. first_row: number of the first sample in its view.
    """
    row = np.arange(len(pixel))
    is_first = np.diff(pixel.astype(np.int64), prepend=-1) != 0
    rank = row - np.maximum.accumulate(np.where(is_first, row, 0))
    y, x = np.divmod(pixel.astype(np.int64), width)
    subcell = (x + rank) % _SIDE * _SIDE + (y + rank // _SIDE) % _SIDE
    return np.asarray(_seeds_by_subcell()[subcell, (first_row + row) % _SEEDS_PER_SUBCELL])


def make_seeds(store: StoreReader, k: int, width: int, start: int, stop: int) -> Shaped[NDArray[np.uint32], " n"]:
    """Return the seeds of samples in a store.

    Args:
        store: with the pixels of the samples. k: index of the view. width: of its image, pixels.
        start, stop: rows of its arrays.
    """
    begin = max(start - _MAX_ROWS_BEFORE, 0)
    pixel = store.read(f"views/{k}/pixel", begin, stop)
    return interleaved_seeds(pixel, width, begin)[start - begin :]
