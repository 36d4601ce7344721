"""What arrives at cells from other cells, quickly: along the same rays, by the squares in which they come and go.

    t_j(c) = π / N Σ_r L(link(c, r), square it leaves by) h̄_j(square it comes in by)

with h̄ the functions' means over squares, and t_j in the frame of the cell. `PatchLight.arriving` is what it estimates.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.thread_pools import parallel_for_chunks
from relume.math.direction_grid import SIDE
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.reflectance_operator import IncidentLight
from relume.transport.outgoing_patch_light import OutgoingLight, bin_means, incident_along

F32 = NDArray[np.float32]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _incident_kernel(  # type: ignore[no-untyped-def]
    gather_hits, outgoing_bins, incident_bins, outgoing, row_index, start, stop, irradiance, binned_light
):
    """Sum the rays of cells [start, stop). row_of: each cell's row among the squares, −1 for none. (C,)"""
    ray_weight = np.float32(np.pi / gather_hits.shape[1])
    light = np.empty((3, gather_hits.shape[1]), np.float32)
    for patch in range(start, stop):
        incident_along(outgoing, gather_hits[patch], outgoing_bins[patch], light)
        for channel in range(3):
            irradiance[patch, channel] = ray_weight * light[channel].sum()
        if row_index[patch] < 0:
            continue
        bins = binned_light[row_index[patch]]
        for ray in range(gather_hits.shape[1]):
            for channel in range(3):
                bins[channel, incident_bins[patch, ray]] += ray_weight * light[channel, ray]


def incident_fast(patches: PatchLight, outgoing: OutgoingLight, rows: NDArray[np.intp]) -> IncidentLight:
    """What arrives from other cells, whose light differs by direction.

    Args:
        patches: that it comes to. outgoing: by all cells. rows: those of which light vectors are wanted. (G,)
    """
    irradiance, binned_light = (
        np.empty((patches.num_patches, 3), np.float32),
        np.zeros((len(rows), 3, SIDE * SIDE), np.float32),
    )
    row_index = np.full(patches.num_patches, -1, np.int32)
    row_index[rows] = np.arange(len(rows))
    args = (patches.gather_hits, patches.outgoing_bins, patches.incident_bins, outgoing, row_index)
    parallel_for_chunks(
        lambda start, stop: _incident_kernel(*args, start, stop, irradiance, binned_light), patches.num_patches
    )
    return IncidentLight(irradiance, binned_light @ bin_means().T)
