"""Light vectors of what cells send to points whose gather rays go alike, quickly.

    t_k(x) = Σ_r w_r h_k(ω_r) L(link(x, r), −ω_r)

Where all points have one seed, ray r leaves each of them in the same local direction, and weighs the same.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.core.thread_pools import parallel_for_chunks
from relume.math.zernike import num_functions, project
from relume.raytrace.gather_rays import RayPattern, lattice_offsets, local_ray, ray_weight
from relume.transport.direction_bins import DirectionBins
from relume.transport.outgoing_patch_light import OutgoingLight, incident_along

F32 = NDArray[np.float32]


def weighted_basis(pattern: RayPattern, seed: int, degree: int) -> F32:
    """Evaluate w_r h_k(ω_r).

    Args:
        pattern: of the rays, all of them by the cosine. seed: of the points. degree: of the functions.
    Returns:
        (K, rays) float32
    """
    if pattern.num_cosine != pattern.num_rays:
        raise ValueError("glossy rays go elsewhere at every point")
    wi, weight = np.empty((pattern.num_rays, 3), np.float32), np.empty(pattern.num_rays, np.float32)
    _generate_rays(pattern, np.uint32(seed), wi, weight)
    functions = project(wi.astype(np.float64))[:, : num_functions(degree)]
    return np.ascontiguousarray((functions * weight[:, None]).T, np.float32)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _generate_rays(pattern, seed, wi, weight):  # type: ignore[no-untyped-def]
    shifts, up = lattice_offsets(pattern, seed), np.float32(1)
    for ray in range(len(wi)):
        x, y, z = local_ray(pattern, ray, shifts, np.float32(0), np.float32(0), up)
        wi[ray, 0], wi[ray, 1], wi[ray, 2] = x, y, z
        weight[ray] = ray_weight(pattern, x, y, z, np.float32(0), np.float32(0), up)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _gather(gather_hits, bins, rows, functions, outgoing, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the rays of points rows[start:stop]. out: (m, 3, K)"""
    num_functions, num_rays = functions.shape
    light = np.empty((3, num_rays), np.float32)
    red, green, blue = light
    for i in range(start, stop):
        incident_along(outgoing, gather_hits[rows[i]], bins[rows[i]], light)
        for k in range(num_functions):
            r = g = b = np.float32(0)
            for ray in range(num_rays):
                value = functions[k, ray]
                r += value * red[ray]
                g += value * green[ray]
                b += value * blue[ray]
            out[i, 0, k], out[i, 1, k], out[i, 2, k] = r, g, b


def shared_direction_coefficients(
    gather_hits: NDArray[np.uint16],
    bins: DirectionBins,
    rows: NDArray[np.intp],
    functions: F32,
    outgoing: OutgoingLight,
) -> F32:
    """Find what rays bring to some points; `ray_incident_coefficients` is its oracle.

    Args:
        gather_hits: cell that each ray of all points hits. (n, rays) uint16
        bins: in which light leaves those cells, from `outgoing_bins`. (n, rays) uint8
        rows: the points. (m,). functions: from `weighted_basis`. (K, rays) float32
        outgoing: by the cells.
    Returns:
        t. (m, 3, K) float32
    """
    out = np.empty((len(rows), 3, len(functions)), np.float32)
    args = (gather_hits, bins, rows, functions, outgoing)
    parallel_for_chunks(lambda start, stop: _gather(*args, start, stop, out), len(rows))
    return out
