"""Incident radiance coefficients of points, in the hemispherical (Zernike) basis of their local frames.

    t_k(x) = ∫ L(x, ωi) V(x, ωi) cos θi h_k(ωi) dωi = Σ_s w_s h_k(ω_s)

s are visible light triangles and rays from patches and local lights. t depends on neither BRDF nor camera: these enter
by the outgoing coefficients (`relume.live.free_camera.basis.outgoing_coefficients`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges, parallel_for_chunks
from relume.lights.spherical_triangles import TriangleLights
from relume.math.zernike import (
    BATCH_RAYS,
    DEGREE,
    LIGHT,
    NUM_COLUMNS,
    WI,
    accumulate,
    num_functions,
    recurrence,
)
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.shading_points import RayList, ShadingPoints, build_ray_lists

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_POINTS_PER_RANGE = 512
_LISTED_POINTS_PER_RANGE = 128


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _from_triangles(recurrence_table, normal, tangent, visible, direction, irradiance, start, stop, out):  # type: ignore[no-untyped-def]
    """Add the visible light triangles of points [start, stop). direction, irradiance: (3, M). out: (n, 3, K)"""
    num_lights = direction.shape[1]
    visible_lights, columns = np.empty(num_lights + 1, np.int32), np.empty(NUM_COLUMNS * BATCH_RAYS, np.float32)
    for p in range(start, stop):
        num_visible = 0
        for m in range(num_lights):  # visibility is unpredictable: no branches
            visible_lights[num_visible] = m
            num_visible += (visible[p, m >> 3] >> (m & 7)) & 1
        n, t = normal[p], tangent[p]
        nx, ny, nz, tx, ty, tz = n[0], n[1], n[2], t[0], t[1], t[2]
        bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        for first in range(0, num_visible, BATCH_RAYS):
            num = min(BATCH_RAYS, num_visible - first)
            for i in range(num):
                m = visible_lights[first + i]
                x, y, z = direction[0, m], direction[1, m], direction[2, m]
                cosine = max(nx * x + ny * y + nz * z, np.float32(0))
                columns[WI + i], columns[WI + BATCH_RAYS + i] = tx * x + ty * y + tz * z, bx * x + by * y + bz * z
                for channel in range(3):
                    columns[LIGHT + channel * BATCH_RAYS + i] = cosine * irradiance[channel, m]
            accumulate(recurrence_table, num, columns, out[p])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _from_listed(recurrence_table, num_points, first, wi, irradiance, out):  # type: ignore[no-untyped-def]
    """Add listed rays, weighted by the cosine, to their points. out: (num_points, 3, K)"""
    columns = np.empty(NUM_COLUMNS * BATCH_RAYS, np.float32)
    for p in range(num_points):
        for begin in range(first[p], first[p + 1], BATCH_RAYS):
            num = min(BATCH_RAYS, first[p + 1] - begin)
            for i in range(num):
                columns[WI + i], columns[WI + BATCH_RAYS + i] = wi[0, begin + i], wi[1, begin + i]
                for channel in range(3):
                    columns[LIGHT + channel * BATCH_RAYS + i] = irradiance[channel, begin + i]
            accumulate(recurrence_table, num, columns, out[p])


def incident_coefficients(
    points: SurfacePoints,
    visible: Shaped[NDArray[np.uint8], "n bytes"],
    lights: TriangleLights,
    rays: Sequence[RayList],
    degree: int = DEGREE,
) -> Shaped[F32, "n 3 K"]:
    """Compute the incident radiance coefficients of points. O(n · (lights + rays) · K) time.

    Args:
        points: n points. visible: visibility bits of the lights, as in `ShadingPoints`.
        lights: triangles of the environment. rays: all other light.
        degree: degree of the basis.
    Returns:
        t, with the cosine, of the functions up to the degree.
    """
    out = np.zeros((points.num_points, 3, num_functions(degree)), np.float32)
    if lights.num_lights:
        direction, irradiance = np.ascontiguousarray(lights.direction.T), np.ascontiguousarray(lights.irradiance.T)
        args = (recurrence(degree), points.normal, points.tangent, visible, direction, irradiance)
        for_ranges(lambda start, stop: _from_triangles(*args, start, stop, out), points.num_points, _POINTS_PER_RANGE)
    _add_rays(points, rays, degree, out)
    return out


def ray_incident_coefficients(
    points: SurfacePoints, rays: Sequence[RayList], degree: int = DEGREE
) -> Shaped[F32, "n 3 K"]:
    """Incident radiance coefficients of points up to a degree from rays alone. See `incident_coefficients`."""
    out = np.zeros((points.num_points, 3, num_functions(degree)), np.float32)
    _add_rays(points, rays, degree, out)
    return out


def _add_rays(points: SurfacePoints, rays: Sequence[RayList], degree: int, out: F32) -> None:
    no_visibility = np.empty((points.num_points, 0), np.uint8)
    # rays do not depend on the view direction
    receivers = ShadingPoints(points, points.normal, no_visibility)
    for some in rays:
        for_ranges(
            lambda start, stop, some=some: _list_and_add(some, receivers, degree, start, stop, out),  # type: ignore[misc]
            points.num_points,
            _LISTED_POINTS_PER_RANGE,
        )


def _list_and_add(rays: RayList, receivers: ShadingPoints, degree: int, start: int, stop: int, out: F32) -> None:
    """Add the rays of points [start, stop)."""
    ray_list = build_ray_lists(rays, receivers, start, stop)
    _from_listed(recurrence(degree), stop - start, ray_list.first, ray_list.wi, ray_list.irradiance, out[start:stop])


def add_scaled(
    total: Shaped[F32, "n 3 K"],
    addend: Shaped[F32, "m 3 k"],
    gain: Shaped[F32, " 3"],
    rows: Shaped[NDArray[np.intp], " rows"] | None = None,
    *,
    has_all_rows: bool = False,
) -> None:
    """Add incident radiance coefficients times a gain per channel to others, in place.

    Args:
        total: added to. addend: coefficients of as many functions or fewer.
        rows: the points that are added; None: all. has_all_rows: `addend` has all n points, not only `rows`.
    """
    target_rows = np.arange(len(total)) if rows is None else rows
    source_rows = target_rows if has_all_rows or rows is None else np.arange(len(addend))
    parallel_for_chunks(
        lambda start, stop: _add_scaled(addend, gain, source_rows, target_rows, start, stop, total), len(target_rows)
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_scaled(addend, gain, source_rows, target_rows, start, stop, out):  # type: ignore[no-untyped-def]
    for i in range(start, stop):
        q, p = source_rows[i], target_rows[i]
        for channel in range(3):
            for k in range(addend.shape[2]):
                out[p, channel, k] += gain[channel] * addend[q, channel, k]
