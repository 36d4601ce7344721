"""Images of a term whose samples are weighted means of a few rows: of shaded samples, or of neighbors."""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks

F32 = NDArray[np.float32]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_interpolated(first, column, weight, rows, start, stop, image):  # type: ignore[no-untyped-def]
    """Add Σ_k w_k rows[k] to samples [start, stop) of an image. first, column, weight: of a matrix in CSR format"""
    num_lanes = image.shape[2]
    for sample in range(start, stop):
        red = green = blue = np.float32(0)
        for k in range(first[sample], first[sample + 1]):
            row, factor = column[k], weight[k]
            red += factor * rows[row, 0]
            green += factor * rows[row, 1]
            blue += factor * rows[row, 2]
        tile, lane = sample // num_lanes, sample % num_lanes
        image[tile, 0, lane] += red
        image[tile, 1, lane] += green
        image[tile, 2, lane] += blue


def add_interpolated(weights: Any, rows: Shaped[F32, "k channels"], image: Shaped[F32, "tiles 3 lanes"]) -> None:
    """Add W rows to an image, in place, as `weights @ rows` without temporary images.

    Args:
        weights: W, sparse float32 in CSR format. (samples, k) rows: at least k, of at least three channels.
        image: of all samples, padded to whole tiles.
    """
    args = weights.indptr, weights.indices, weights.data, rows
    parallel_for_chunks(lambda start, stop: _add_interpolated(*args, start, stop, image), weights.shape[0])
