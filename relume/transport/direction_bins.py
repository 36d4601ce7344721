"""Direction bins of gather rays, where they leave a patch and where they reach one.

They depend on the bake alone. Computed once, they save incremental updates of the light from generating all ray
directions again.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.gather_rays import RayPattern, cosine_ray, lattice_offsets
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.outgoing_patch_light import bin_of

F32 = NDArray[np.float32]
DirectionBins = NDArray[np.uint8]

_POINTS_PER_RANGE = 1024


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _ray_direction(n, t, pattern, ray, shifts):  # type: ignore[no-untyped-def]
    """Return the world-space direction of a ray of a point with normal n and tangent t."""
    x, y, z = cosine_ray(pattern.rays[ray], shifts)
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    return t[0] * x + bx * y + n[0] * z, t[1] * x + by * y + n[1] * z, t[2] * x + bz * y + n[2] * z


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _fill_outgoing_bins(points, gather_hits, pattern, frames, start, stop, out):  # type: ignore[no-untyped-def]
    """Find the bins of patches in which points [start, stop) see them."""
    for p in range(start, stop):
        shifts = lattice_offsets(pattern, points.seed[p])[0]
        for ray in range(gather_hits.shape[1]):
            patch = gather_hits[p, ray]
            if patch != NO_PATCH:
                x, y, z = _ray_direction(points.normal[p], points.tangent[p], pattern, ray, shifts)
                out[p, ray] = bin_of(frames, patch, -x, -y, -z)


def outgoing_bins(
    points: SurfacePoints,
    gather_hits: Shaped[NDArray[np.uint16], "n rays"],
    pattern: RayPattern,
    frames: Shaped[F32, "patches 2 3"],
) -> Shaped[DirectionBins, "n rays"]:
    """Compute the direction bin, at the patch that a ray hits, toward the ray's origin.

    Args:
        points: ray origins. gather_hits: patches that the rays hit. pattern: the rays' directions.
        frames: tangents and bitangents of the patches.
    Returns:
        Bin of each ray; zero for a ray that hits no patch.
    """
    out = np.zeros(gather_hits.shape, np.uint8)
    for_ranges(
        lambda start, stop: _fill_outgoing_bins(points, gather_hits, pattern, frames, start, stop, out),
        len(gather_hits),
        _POINTS_PER_RANGE,
    )
    return out


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _fill_incoming_bins(points, points_per_patch, pattern, frames, start, stop, out):  # type: ignore[no-untyped-def]
    """Find the bins in which rays of points [start, stop) reach their own patches."""
    for p in range(start, stop):
        shifts = lattice_offsets(pattern, points.seed[p])[0]
        for ray in range(out.shape[1]):
            x, y, z = _ray_direction(points.normal[p], points.tangent[p], pattern, ray, shifts)
            out[p, ray] = bin_of(frames, p // points_per_patch, x, y, z)


def incoming_bins(
    points: SurfacePoints, points_per_patch: int, pattern: RayPattern, frames: Shaped[F32, "patches 2 3"]
) -> Shaped[DirectionBins, "n rays"]:
    """Compute the direction bin of each ray in the frame of its own patch.

    Args:
        points: `points_per_patch` points of each patch, patch by patch. pattern: the rays' directions.
        frames: as in `outgoing_bins`.
    """
    out = np.empty((points.num_points, pattern.num_rays), np.uint8)
    args = (points, points_per_patch, pattern, frames)
    for_ranges(lambda start, stop: _fill_incoming_bins(*args, start, stop, out), points.num_points, _POINTS_PER_RANGE)
    return out
