"""Basis functions of patches' outgoing light, averaged over the directions in which other patches see them."""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.math.direction_grid import SIDE
from relume.patches.patch_kdtree import NO_PATCH
from relume.transport.direction_bins import DirectionBins
from relume.transport.outgoing_patch_light import bin_means

F32 = NDArray[np.float32]


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _count(gather_hits, bins, counts):  # type: ignore[no-untyped-def]
    """Count rays by the patch that they hit and their direction bin there. counts: (C, SIDE²)"""
    for p in range(gather_hits.shape[0]):
        for ray in range(gather_hits.shape[1]):
            if gather_hits[p, ray] != NO_PATCH:
                counts[gather_hits[p, ray], bins[p, ray]] += np.float32(1)


def mean_incoming(
    gather_hits: Shaped[NDArray[np.uint16], "n rays"], bins: Shaped[DirectionBins, "n rays"], num_patches: int
) -> Shaped[F32, "patches J"]:
    """Average every basis function over the directions of rays that hit a patch; zero if none does.

    Args:
        gather_hits: patches that rays hit. bins: their direction bins there.
        num_patches: number of patches of the scene.
    """
    counts = np.zeros((num_patches, SIDE * SIDE), np.float32)
    _count(gather_hits, bins, counts)
    return np.asarray(counts @ bin_means().T / np.maximum(counts.sum(axis=1, keepdims=True), 1), np.float32)
