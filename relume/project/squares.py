"""Where light leaves a cell by a ray, and where it comes in, as squares of the grid that cells send by.

They follow from what is baked alone. Found once, they spare whoever makes light anew while a hand moves the directions
of all rays.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.light.gather_rays import Pattern, cosine_ray, small_shifts_of
from relume.parallel import for_ranges
from relume.points import Points
from relume.project.sent import square_of
from relume.trace.cell_tree import NO_CELL
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
Squares = NDArray[np.uint8]

_POINTS_A_RANGE = 1024


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _towards(n, t, pattern, ray, shifts):  # type: ignore[no-untyped-def]
    """Direct a ray of a point with normal n and tangent t, in world space."""
    x, y, z = cosine_ray(pattern.rays[ray], shifts)
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    return t[0] * x + bx * y + n[0] * z, t[1] * x + by * y + n[1] * z, t[2] * x + bz * y + n[2] * z


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _leaving(points, links, pattern, frames, start, stop, out):  # type: ignore[no-untyped-def]
    """Find the squares in which cells are seen by points [start, stop)."""
    for p in range(start, stop):
        shifts = small_shifts_of(pattern, points.seed[p])[0]
        for ray in range(links.shape[1]):
            cell = links[p, ray]
            if cell != NO_CELL:
                x, y, z = _towards(points.normal[p], points.tangent[p], pattern, ray, shifts)
                out[p, ray] = square_of(frames, cell, -x, -y, -z)


def leaving_squares(points: Points, links: NDArray[np.uint16], pattern: Pattern, frames: F32) -> Squares:
    """Find the squares in which cells are seen.

    Args:
        points: where rays leave. links: cells that they hit. (n, rays) uint16. pattern: their directions.
        frames: tangents and bitangents of the cells. (C, 2, 3) float32
    Returns:
        Of the cell that each ray hits; nothing where it hits none. (n, rays) uint8
    """
    out = np.zeros(links.shape, np.uint8)
    for_ranges(
        lambda start, stop: _leaving(points, links, pattern, frames, start, stop, out), len(links), _POINTS_A_RANGE
    )
    return out


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _coming(points, points_a_cell, pattern, frames, start, stop, out):  # type: ignore[no-untyped-def]
    """Find the squares in which rays of points [start, stop) come into their own cells."""
    for p in range(start, stop):
        shifts = small_shifts_of(pattern, points.seed[p])[0]
        for ray in range(out.shape[1]):
            x, y, z = _towards(points.normal[p], points.tangent[p], pattern, ray, shifts)
            out[p, ray] = square_of(frames, p // points_a_cell, x, y, z)


def coming_squares(points: Points, points_a_cell: int, pattern: Pattern, frames: F32) -> Squares:
    """Find the squares in which the rays of cells come in.

    Args:
        points: of the cells, `points_a_cell` of each, one after another. pattern: the directions of their rays.
        frames: as of `leaving_squares`.
    Returns:
        In the frame of the cell whose point it is. (n, rays) uint8
    """
    out = np.empty((points.num_points, pattern.num_rays), np.uint8)
    args = (points, points_a_cell, pattern, frames)
    for_ranges(lambda start, stop: _coming(*args, start, stop, out), points.num_points, _POINTS_A_RANGE)
    return out
