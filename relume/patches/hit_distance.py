"""Distances along gather rays, from the patches that they hit."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.patches.patch_kdtree import NO_PATCH

F32 = NDArray[np.float32]

_STRIDE = 4  # every fourth ray is enough for a mean
_LEAST_DISTANCE = np.float32(1e-6)  # of a point that is the center of a patch
_POINTS_PER_RANGE = 4096


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _mean_inverse_distance(position, gather_hits, center, start, stop, out):  # type: ignore[no-untyped-def]
    """Write points [start, stop); see `mean_inverse_distance`."""
    num_rays = gather_hits.shape[1]
    num = np.float32((num_rays + _STRIDE - 1) // _STRIDE)
    for p in range(start, stop):
        total = np.float32(0)
        for ray in range(0, num_rays, _STRIDE):
            patch = gather_hits[p, ray]
            if patch == NO_PATCH:
                continue
            squared = np.float32(0)
            for axis in range(3):
                offset = center[patch, axis] - position[p, axis]
                squared += offset * offset
            total += np.float32(1) / max(np.float32(math.sqrt(squared)), _LEAST_DISTANCE)
        out[p] = total / num


def mean_inverse_distance(
    position: Shaped[F32, "n 3"],
    gather_hits: Shaped[NDArray[np.uint16], "n rays"],
    patch_position: Shaped[F32, "patches points 3"],
) -> Shaped[F32, " n"]:
    """Return the mean of 1 / distance over the cosine rays of points, zero for rays that leave the scene.

    Its inverse is the harmonic mean distance to the surfaces around a point. A ray ends at the center of its patch.

    Args:
        position: of the points. gather_hits: patch that each ray hits. patch_position: sample points of each patch.
    """
    center, out = patch_position.mean(axis=1, dtype=np.float32), np.empty(len(position), np.float32)

    def kernel(start: int, stop: int) -> None:
        _mean_inverse_distance(position, gather_hits, center, start, stop, out)

    for_ranges(kernel, len(position), _POINTS_PER_RANGE)
    return out
