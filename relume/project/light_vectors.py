"""Light vectors: what arrives at points, in the in-basis of their own hemispheres.

    t_k(x) = ∫ L(x, ωi) V(x, ωi) cos θi h_k(ωi) dωi = Σ_s w_s h_k(ω_s)

where s are light triangles that the point sees, and rays from cells and local lights. Nothing of it knows a BRDF or an
eye: they multiply it (`relume.moving.basis.out_factors`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import AT_ONCE, DEGREE, LIGHT, NUM_COLUMNS, WI, add_light, in_basis, ladder, num_functions
from relume.light.triangles import TriangleLights
from relume.parallel import for_ranges, for_shares
from relume.points import Points
from relume.project.receivers import Rays, Receivers, listed
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_POINTS_A_RANGE = 512
_LISTED_A_RANGE = 128


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _from_triangles(rungs, normal, tangent, visible, direction, irradiance, start, stop, out):  # type: ignore[no-untyped-def]
    """Add the light triangles that points [start, stop) see. direction, irradiance: (3, M). out: (n, 3, K)"""
    num_lights = direction.shape[1]
    seen, columns = np.empty(num_lights + 1, np.int32), np.empty(NUM_COLUMNS * AT_ONCE, np.float32)
    for p in range(start, stop):
        num_seen = 0
        for m in range(num_lights):  # without branches, which nothing foretells
            seen[num_seen] = m
            num_seen += (visible[p, m >> 3] >> (m & 7)) & 1
        n, t = normal[p], tangent[p]
        nx, ny, nz, tx, ty, tz = n[0], n[1], n[2], t[0], t[1], t[2]
        bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        for first in range(0, num_seen, AT_ONCE):
            num = min(AT_ONCE, num_seen - first)
            for i in range(num):
                m = seen[first + i]
                x, y, z = direction[0, m], direction[1, m], direction[2, m]
                cosine = max(nx * x + ny * y + nz * z, np.float32(0))
                columns[WI + i], columns[WI + AT_ONCE + i] = tx * x + ty * y + tz * z, bx * x + by * y + bz * z
                for channel in range(3):
                    columns[LIGHT + channel * AT_ONCE + i] = cosine * irradiance[channel, m]
            add_light(rungs, num, columns, out[p])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _from_listed(rungs, num_points, first, wi, irradiance, out):  # type: ignore[no-untyped-def]
    """Add listed rays, whose light has been weighed by the cosine, to their points. out: (num_points, 3, K)"""
    columns = np.empty(NUM_COLUMNS * AT_ONCE, np.float32)
    for p in range(num_points):
        for begin in range(first[p], first[p + 1], AT_ONCE):
            num = min(AT_ONCE, first[p + 1] - begin)
            for i in range(num):
                columns[WI + i], columns[WI + AT_ONCE + i] = wi[0, begin + i], wi[1, begin + i]
                for channel in range(3):
                    columns[LIGHT + channel * AT_ONCE + i] = irradiance[channel, begin + i]
            add_light(rungs, num, columns, out[p])


def light_vectors(
    points: Points, visible: NDArray[np.uint8], lights: TriangleLights, rays: Sequence[Rays], degree: int = DEGREE
) -> F32:
    """Find what arrives at points, as vectors.

    Args:
        points: n of them. visible: which of the lights each sees, as in `Receivers`. (n, bytes) uint8
        lights: triangles of the environment. rays: what brings light besides.
        degree: of the functions.
    Returns:
        t, radiance times solid angle, of the functions up to the degree alone. (n, 3, functions) float32
    Cost: O(n · (lights + rays) · K) time.
    """
    out = np.zeros((points.num_points, 3, num_functions(degree)), np.float32)
    if lights.num_lights:
        direction, irradiance = np.ascontiguousarray(lights.direction.T), np.ascontiguousarray(lights.irradiance.T)
        args = (ladder(degree), points.normal, points.tangent, visible, direction, irradiance)
        for_ranges(lambda start, stop: _from_triangles(*args, start, stop, out), points.num_points, _POINTS_A_RANGE)
    _add_rays(points, rays, degree, out)
    return out


def ray_vectors(points: Points, rays: Sequence[Rays], degree: int = DEGREE) -> F32:
    """Do as `light_vectors` where all light comes along rays.

    Args:
        points, rays, degree: as there.
    Returns:
        As there.
    """
    out = np.zeros((points.num_points, 3, num_functions(degree)), np.float32)
    _add_rays(points, rays, degree, out)
    return out


def _add_rays(points: Points, rays: Sequence[Rays], degree: int, out: F32) -> None:
    nothing = np.empty((points.num_points, 0), np.uint8)
    receivers = Receivers(points, points.normal, nothing)  # no ray of a point depends on where it is seen from
    for some in rays:
        for_ranges(
            lambda start, stop, some=some: _list_and_add(some, receivers, degree, start, stop, out),  # type: ignore[misc]
            points.num_points,
            _LISTED_A_RANGE,
        )


def _list_and_add(rays: Rays, receivers: Receivers, degree: int, start: int, stop: int, out: F32) -> None:
    """Add rays of points [start, stop)."""
    found = listed(rays, receivers, start, stop)
    _from_listed(ladder(degree), stop - start, found.first, found.wi, found.irradiance, out[start:stop])


def light_vectors_numpy(points: Points, visible: NDArray[np.uint8], lights: TriangleLights) -> F64:
    """Do as `light_vectors` for light triangles alone, in plain NumPy: its oracle.

    Args:
        points, visible, lights: as there.
    Returns:
        (n, 3, K) float64
    """
    n, t = points.normal.astype(np.float64), points.tangent.astype(np.float64)
    frame = np.stack([t, np.cross(n, t), n], axis=1)
    wi = np.einsum("nij,mj->nmi", frame, lights.direction.astype(np.float64))
    sees = np.unpackbits(visible, axis=1, count=lights.num_lights, bitorder="little").astype(np.float64)
    weight = sees * np.maximum(wi[..., 2], 0)
    return np.asarray(np.einsum("nm,mc,nmk->nck", weight, lights.irradiance.astype(np.float64), in_basis(wi)))


def add_scaled(
    total: F32, part: F32, gain: F32, rows: NDArray[np.intp] | None = None, *, is_of_all: bool = False
) -> None:
    """Add light vectors times a gain of each channel to others.

    Args:
        total: what they are added to. (n, 3, K) float32
        part: that is added, of as many functions or fewer. (m, 3, ≤ K) float32. gain: (3,) float32
        rows: which of the n they are. (m,); None: all. is_of_all: `part` has all n, of which `rows` are added.
    """
    into = np.arange(len(total)) if rows is None else rows
    of = into if is_of_all or rows is None else np.arange(len(part))
    for_shares(lambda start, stop: _add_scaled(part, gain, of, into, start, stop, total), len(into))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _add_scaled(part, gain, of, into, start, stop, out):  # type: ignore[no-untyped-def]
    for i in range(start, stop):
        q, p = of[i], into[i]
        for channel in range(3):
            for k in range(part.shape[2]):
                out[p, channel, k] += gain[channel] * part[q, channel, k]
