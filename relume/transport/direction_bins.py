"""Where light leaves a cell by a ray, and where it comes in, as squares of the grid that cells send by.

They follow from what is baked alone. Found once, they spare whoever makes light anew while a hand moves the directions
of all rays.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.core.thread_pools import for_ranges
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.gather_rays import RayPattern, cosine_ray, lattice_offsets
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.outgoing_patch_light import bin_of

F32 = NDArray[np.float32]
DirectionBins = NDArray[np.uint8]

_POINTS_PER_RANGE = 1024


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _ray_direction(n, t, pattern, ray, shifts):  # type: ignore[no-untyped-def]
    """Direct a ray of a point with normal n and tangent t, in world space."""
    x, y, z = cosine_ray(pattern.rays[ray], shifts)
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    return t[0] * x + bx * y + n[0] * z, t[1] * x + by * y + n[1] * z, t[2] * x + bz * y + n[2] * z


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _fill_outgoing_bins(points, gather_hits, pattern, frames, start, stop, out):  # type: ignore[no-untyped-def]
    """Find the squares in which cells are seen by points [start, stop)."""
    for p in range(start, stop):
        shifts = lattice_offsets(pattern, points.seed[p])[0]
        for ray in range(gather_hits.shape[1]):
            patch = gather_hits[p, ray]
            if patch != NO_PATCH:
                x, y, z = _ray_direction(points.normal[p], points.tangent[p], pattern, ray, shifts)
                out[p, ray] = bin_of(frames, patch, -x, -y, -z)


def outgoing_bins(
    points: SurfacePoints, gather_hits: NDArray[np.uint16], pattern: RayPattern, frames: F32
) -> DirectionBins:
    """Find the squares in which cells are seen.

    Args:
        points: where rays leave. gather_hits: cells that they hit. (n, rays) uint16. pattern: their directions.
        frames: tangents and bitangents of the cells. (C, 2, 3) float32
    Returns:
        Of the cell that each ray hits; nothing where it hits none. (n, rays) uint8
    """
    out = np.zeros(gather_hits.shape, np.uint8)
    for_ranges(
        lambda start, stop: _fill_outgoing_bins(points, gather_hits, pattern, frames, start, stop, out),
        len(gather_hits),
        _POINTS_PER_RANGE,
    )
    return out


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _fill_incoming_bins(points, points_per_patch, pattern, frames, start, stop, out):  # type: ignore[no-untyped-def]
    """Find the squares in which rays of points [start, stop) come into their own cells."""
    for p in range(start, stop):
        shifts = lattice_offsets(pattern, points.seed[p])[0]
        for ray in range(out.shape[1]):
            x, y, z = _ray_direction(points.normal[p], points.tangent[p], pattern, ray, shifts)
            out[p, ray] = bin_of(frames, p // points_per_patch, x, y, z)


def incoming_bins(points: SurfacePoints, points_per_patch: int, pattern: RayPattern, frames: F32) -> DirectionBins:
    """Find the squares in which the rays of cells come in.

    Args:
        points: of the cells, `points_per_patch` of each, one after another. pattern: the directions of their rays.
        frames: as of `outgoing_bins`.
    Returns:
        In the frame of the cell whose point it is. (n, rays) uint8
    """
    out = np.empty((points.num_points, pattern.num_rays), np.uint8)
    args = (points, points_per_patch, pattern, frames)
    for_ranges(lambda start, stop: _fill_incoming_bins(*args, start, stop, out), points.num_points, _POINTS_PER_RANGE)
    return out
