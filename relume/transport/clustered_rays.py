"""Fast incident radiance coefficients for points that share one pattern of gather rays.

    t_k(x) = Σ_r w_r h_k(ω_r) L(hit(x, r), −ω_r)

If all points have the same seed, ray r has the same local direction and weight at each point.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.math.zernike import basis_functions, num_functions
from relume.raytrace.gather_rays import RayPattern, lattice_offsets, local_ray, ray_weight
from relume.transport.direction_bins import DirectionBins
from relume.transport.outgoing_patch_light import OutgoingLight, incident_along

F32 = NDArray[np.float32]


def weighted_basis(pattern: RayPattern, seed: int, degree: int) -> Shaped[F32, "K rays"]:
    """Evaluate w_r h_k(ω_r) for each ray, including the cosine.

    Args:
        pattern: pattern of the rays, all cosine-distributed. seed: seed of the points. degree: degree of the basis.
    Raises:
        ValueError: the pattern has glossy rays.
    """
    if pattern.num_cosine != pattern.num_rays:
        raise ValueError("expected cosine-distributed rays: glossy rays have another direction at each point")
    wi, weight = np.empty((pattern.num_rays, 3), np.float32), np.empty(pattern.num_rays, np.float32)
    _generate_rays(pattern, np.uint32(seed), wi, weight)
    functions = basis_functions(wi.astype(np.float64))[:, : num_functions(degree)]
    return np.ascontiguousarray((functions * weight[:, None]).T, np.float32)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
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
    gather_hits: Shaped[NDArray[np.uint16], "n rays"],
    bins: Shaped[DirectionBins, "n rays"],
    rows: Shaped[NDArray[np.intp], " m"],
    functions: Shaped[F32, "K rays"],
    outgoing: OutgoingLight,
) -> Shaped[F32, "m 3 K"]:
    """Compute the incident radiance coefficients of points from patches; reference: `ray_incident_coefficients`.

    Args:
        gather_hits: patch that each ray of all points hits.
        bins: direction bins of the rays at these patches, from `outgoing_bins`.
        rows: the points. functions: from `weighted_basis`. outgoing: outgoing radiance of the patches.
    """
    out = np.empty((len(rows), 3, len(functions)), np.float32)
    args = (gather_hits, bins, rows, functions, outgoing)
    parallel_for_chunks(lambda start, stop: _gather(*args, start, stop, out), len(rows))
    return out
