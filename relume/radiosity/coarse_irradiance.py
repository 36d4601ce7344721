"""Fast incident light of patches from other patches: along the same rays, by direction bins at both ends.

    t_j(c) = π / N Σ_r L(hit(c, r), outgoing bin) h̄_j(incident bin)

h̄ are the averages of the basis functions over bins, and t_j is in the frame of the patch. It approximates
`PatchLight.incident_light`.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
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
    """Sum the rays of patches [start, stop). row_index: row of each patch in binned_light, −1 for none. (C,)"""
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


def incident_fast(patches: PatchLight, outgoing: OutgoingLight, rows: Shaped[NDArray[np.intp], " G"]) -> IncidentLight:
    """Approximate the incident light of patches from other patches with directional light.

    Args:
        patches: the receivers. outgoing: outgoing light of all patches. rows: patches that need coefficients.
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
