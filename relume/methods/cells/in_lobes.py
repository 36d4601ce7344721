"""What gather cells send of light that comes straight to them, where few functions do not tell their highlights.

    L(c, s) = Σ_k g_k(c) Σ_b E_b(c) T_k(b, s),   E_b(c) = Σ_l V_l E_l cos θ_l   over the lights l in bin b

with T of the highlights k of its material (`relume.brdf.lobe_tables`) and g their colours and textures. All points of
a cell count. Where their normals differ, light comes from where the cell's own normal mirrors it to as theirs do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.lobe_grid import HALF_BINS, NUM_BINS, NUM_MIRRORINGS, NUM_SQUARES, mirrored_squares
from relume.light.triangles import TriangleLights
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.lobes import Lobes
from relume.parallel import for_ranges
from relume.project.receivers import Rays, Receivers, listed
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

_CELLS_A_RANGE = 16  # their bins stay in the cache
_ALIKE = np.float32(0.9998)  # cosine between normals, 1°


class Coming(NamedTuple):
    """Light that comes to some cells.

    Attributes:
        lights: triangles of the environment. visible: which of them points see. (G, points a cell, bytes) uint8
        rays: of the same points, those of local lights.
    """

    lights: TriangleLights | None = None
    visible: NDArray[np.uint8] | None = None
    rays: Sequence[Rays] = ()


def sent_in_lobes(cells: CellLight, lobes: Lobes, coming: Coming) -> F32:
    """Find what cells send of light that comes to them.

    Args:
        cells: that send it. lobes: the highlights of some of them.
        coming: what comes to them.
    Returns:
        Of each of the cells of `lobes`, by squares. (G, 3, `NUM_SQUARES`) float32
    """
    out = np.zeros((len(lobes.rows), 3, NUM_SQUARES), np.float32)
    points = cells.points_of(lobes.rows)
    frames, num = cells.frames[lobes.rows], cells.points_a_cell
    nothing = np.empty((points.num_points, 0), np.uint8)
    receivers = Receivers(points, points.normal, nothing)

    def fill(start: int, stop: int) -> None:
        bins = np.zeros((stop - start, NUM_MIRRORINGS, NUM_BINS, 3), np.float32)
        normals = points.normal[num * start : num * stop].reshape(stop - start, num, 3)
        if coming.lights is not None and coming.visible is not None:
            of_lights = coming.visible[start:stop], coming.lights.direction, coming.lights.irradiance
            _add_triangles(frames[start:stop], normals, *of_lights, bins)
        some = points.rows(slice(num * start, num * stop))
        for rays in coming.rays:
            found = listed(rays, receivers, num * start, num * stop)
            _add_listed(frames[start:stop], some, found.first, found.wi, found.irradiance, bins)
        of_cells = lobes.which[start:stop], lobes.gain[start:stop]
        _spread(bins, *of_cells, lobes.tables, mirrored_squares(), out[start:stop])

    for_ranges(fill, len(lobes.rows), _CELLS_A_RANGE)
    return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _bin_of(frame, n, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Find the mirroring and the bin of light from a direction, as a point with normal n mirrors it."""
    t, b = frame[0], frame[1]
    mx, my, mz = t[1] * b[2] - t[2] * b[1], t[2] * b[0] - t[0] * b[2], t[0] * b[1] - t[1] * b[0]
    twice = np.float32(2) * (n[0] * dx + n[1] * dy + n[2] * dz)
    rx, ry, rz = twice * n[0] - dx, twice * n[1] - dy, twice * n[2] - dz
    up = max(mx * rx + my * ry + mz * rz, np.float32(0))
    x, y = -(t[0] * rx + t[1] * ry + t[2] * rz), -(b[0] * rx + b[1] * ry + b[2] * rz)
    mirroring = np.int64(x < 0) + 2 * np.int64(y < 0)
    scale = np.float32(HALF_BINS) / (np.float32(1) + up)
    i: Any = min(np.int64(scale * abs(x)), HALF_BINS - 1)
    j: Any = min(np.int64(scale * abs(y)), HALF_BINS - 1)
    if j > i:
        i, j, mirroring = j, i, mirroring + 4
    return mirroring, i * (i + 1) // 2 + j


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _are_alike(normals):  # type: ignore[no-untyped-def]
    for p in range(1, normals.shape[0]):
        n, m = normals[0], normals[p]
        if n[0] * m[0] + n[1] * m[1] + n[2] * m[2] < _ALIKE:
            return False
    return True


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _add_triangles(frames, normals, visible, direction, irradiance, bins):  # type: ignore[no-untyped-def]
    """Put the light triangles that the points of cells see into bins.

    Args:
        frames: of the cells. (G, 2, 3). normals: of their points. (G, P, 3). visible: to these. (G, P, bytes) uint8
        direction, irradiance: of the lights. (M, 3)
        bins: added to. (G, `NUM_MIRRORINGS`, `NUM_BINS`, 3)
    """
    num_points = normals.shape[1]
    share = np.float32(1 / num_points)
    for g in range(bins.shape[0]):
        are_alike = _are_alike(normals[g])
        for p in range(1 if are_alike else num_points):
            n = normals[g, p]
            for m in range(direction.shape[0]):
                dx, dy, dz = direction[m, 0], direction[m, 1], direction[m, 2]
                cosine = n[0] * dx + n[1] * dy + n[2] * dz
                seen = np.int64(0)
                for q in range(num_points):
                    if are_alike or q == p:
                        seen += (visible[g, q, m >> 3] >> (m & 7)) & 1
                if seen == 0 or cosine <= 0:
                    continue
                mirroring, b = _bin_of(frames[g], n, dx, dy, dz)
                for channel in range(3):
                    bins[g, mirroring, b, channel] += share * seen * cosine * irradiance[m, channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _add_listed(frames, points, first, wi, irradiance, bins):  # type: ignore[no-untyped-def]
    """The same of listed rays, whose light has been weighed by the cosine. points: of the cells. wi: (3, K) local"""
    num_points = points.normal.shape[0] // bins.shape[0]
    share = np.float32(1 / num_points)
    for p in range(points.normal.shape[0]):
        g, n, t = p // num_points, points.normal[p], points.tangent[p]
        bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
        for ray in range(first[p], first[p + 1]):
            x, y, z = wi[0, ray], wi[1, ray], wi[2, ray]
            dx, dy, dz = t[0] * x + bx * y + n[0] * z, t[1] * x + by * y + n[1] * z, t[2] * x + bz * y + n[2] * z
            mirroring, b = _bin_of(frames[g], n, dx, dy, dz)
            for channel in range(3):
                bins[g, mirroring, b, channel] += share * irradiance[channel, ray]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _spread(bins, which, gain, tables, mirrored, out):  # type: ignore[no-untyped-def]
    """Spread binned light into squares.

    Args:
        bins: light. (G, `NUM_MIRRORINGS`, `NUM_BINS`, 3). which: tables of each cell, −1 for none. (G, terms)
        gain: of each. (G, terms, 3). tables: T of all highlights. (tables, `NUM_BINS`, 1 or 3, `NUM_SQUARES`)
        mirrored: see `mirrored_squares`. out: added to. (G, 3, `NUM_SQUARES`)
    """
    blue, found = tables.shape[2] - 1, np.empty((3, out.shape[2]), np.float32)
    for g in range(out.shape[0]):
        for mirroring in range(bins.shape[1]):
            found[:] = 0
            for b in range(bins.shape[2]):
                if bins[g, mirroring, b, 0] + bins[g, mirroring, b, 1] + bins[g, mirroring, b, 2] == 0:
                    continue
                for k in range(which.shape[1]):
                    if which[g, k] < 0:
                        continue
                    for channel in range(3):
                        row = tables[which[g, k], b, channel * blue // 2]
                        light = gain[g, k, channel] * bins[g, mirroring, b, channel]
                        for square in range(row.shape[0]):
                            found[channel, square] += light * row[square]
            for channel in range(3):
                for square in range(out.shape[2]):
                    out[g, channel, square] += found[channel, mirrored[mirroring, square]]
