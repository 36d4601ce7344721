"""From where gather cells are seen by each other: the mean of the functions by which they send light."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.math.direction_grid import SIDE
from relume.patches.patch_kdtree import NO_PATCH
from relume.transport.direction_bins import DirectionBins
from relume.transport.outgoing_patch_light import bin_means

F32 = NDArray[np.float32]


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _count(gather_hits, bins, counts):  # type: ignore[no-untyped-def]
    """Count rays by the cell that they hit and the square that they come from. counts: (C, SIDE²)"""
    for p in range(gather_hits.shape[0]):
        for ray in range(gather_hits.shape[1]):
            if gather_hits[p, ray] != NO_PATCH:
                counts[gather_hits[p, ray], bins[p, ray]] += np.float32(1)


def mean_incoming(gather_hits: NDArray[np.uint16], bins: DirectionBins, num_patches: int) -> F32:
    """Mean of every function over the directions in which rays see cells.

    Args:
        gather_hits: cells that rays hit. (n, rays) uint16. bins: in which they see them. (n, rays) uint8
        num_patches: C.
    Returns:
        Zero where nothing sees a cell. (C, J) float32
    """
    counts = np.zeros((num_patches, SIDE * SIDE), np.float32)
    _count(gather_hits, bins, counts)
    return np.asarray(counts @ bin_means().T / np.maximum(counts.sum(axis=1, keepdims=True), 1), np.float32)
