"""Transport between patches by direction bins: their mean outgoing basis, and fast incident light.

    t_j(c) = π / N Σ_r L(hit(c, r), outgoing bin) h̄_j(incident bin)

h̄ are the averages of the basis functions over bins, and t_j is in the frame of the patch. The sum approximates
`PatchLight.incident_light` along the same rays.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.math.direction_grid import SIDE
from relume.patches.patch_kdtree import NO_PATCH
from relume.radiosity.reflectance_operator import IncidentLight
from relume.transport.direction_bins import DirectionBins
from relume.transport.outgoing_patch_light import OutgoingLight, bin_means, incident_along

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


def incident_by_bins(
    gather_hits: Shaped[NDArray[np.uint16], "patches rays"],
    outgoing_bins: Shaped[DirectionBins, "patches rays"],
    incident_bins: Shaped[DirectionBins, "patches rays"],
    outgoing: OutgoingLight,
    rows: Shaped[NDArray[np.intp], " G"],
) -> IncidentLight:
    """Approximate the incident light of patches from other patches with directional light.

    Args:
        gather_hits: patches that rays hit. outgoing_bins, incident_bins: direction bins of the rays, there and here.
        outgoing: outgoing light of all patches. rows: patches that need coefficients.
    """
    irradiance = np.empty((len(gather_hits), 3), np.float32)
    binned_light = np.zeros((len(rows), 3, SIDE * SIDE), np.float32)
    row_index = np.full(len(gather_hits), -1, np.int32)
    row_index[rows] = np.arange(len(rows))
    args = gather_hits, outgoing_bins, incident_bins, outgoing, row_index
    parallel_for_chunks(
        lambda start, stop: _incident_kernel(*args, start, stop, irradiance, binned_light), len(gather_hits)
    )
    return IncidentLight(irradiance, binned_light @ bin_means().T)
