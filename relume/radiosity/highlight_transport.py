"""Direct light reflected by sharp highlights of patches, for which the low-degree basis is too coarse.

    L(c, s) = Σ_k g_k(c) Σ_b E_b(c) T_k(b, s),   E_b(c) = Σ_l V_l E_l cos θ_l   over the lights l in bin b

T are the tables of the highlights k of its material (`relume.brdf.highlight_tables`) and g their colors and textures.
All points of a patch contribute, in previews only one to local lights. If their normals differ, a light is binned in
the direction from which the patch normal reflects it as the point's normal does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.lights.spherical_triangles import TriangleLights
from relume.math.direction_grid import (
    FINE_BINS_PER_RADIUS,
    NUM_DIRECTION_BINS,
    NUM_FINE_BINS,
    NUM_REFLECTIONS,
    reflected_bins,
)
from relume.radiosity.highlight_tables import HighlightTables
from relume.radiosity.patch_irradiance import PatchLight
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.shading_points import RayList, ShadingPoints, build_ray_lists

F32 = NDArray[np.float32]

_PATCHES_PER_RANGE = 16  # their bins stay in the cache
_PARALLEL_COSINE = np.float32(0.9998)  # of the angle between normals, 1°


class DirectLobes(NamedTuple):
    """Direct light at some patches.

    Attributes:
        lights: triangles of the environment. visible: these lights from the sample points.
        rays: rays from local lights.
        ray_points: points of the rays, patch by patch, the same number of each; None: all sample points.
    """

    lights: TriangleLights | None = None
    visible: Shaped[NDArray[np.uint8], "G points bytes"] | None = None
    rays: Sequence[RayList] = ()
    ray_points: SurfacePoints | None = None


def outgoing_in_highlights(
    patches: PatchLight, highlights: HighlightTables, direct_lobes: DirectLobes
) -> Shaped[F32, "G 3 bins"]:
    """Return the binned outgoing radiance by highlights, for each patch of `highlights`.

    Args:
        patches: patches of the bake. highlights: highlights of some patches. direct_lobes: their direct light.
    """
    out = np.zeros((len(highlights.rows), 3, NUM_DIRECTION_BINS), np.float32)
    points = patches.points_of(highlights.rows)
    frames, points_per_patch = patches.frames[highlights.rows], patches.points_per_patch
    ray_points = points if direct_lobes.ray_points is None else direct_lobes.ray_points
    ray_points_per_patch = ray_points.num_points // max(1, len(frames))
    receivers = ShadingPoints(ray_points, ray_points.normal, np.empty((ray_points.num_points, 0), np.uint8))

    def fill(start: int, stop: int) -> None:
        bins = np.zeros((stop - start, NUM_REFLECTIONS, NUM_FINE_BINS, 3), np.float32)
        normals = points.normal[points_per_patch * start : points_per_patch * stop].reshape(
            stop - start, points_per_patch, 3
        )
        if direct_lobes.lights is not None and direct_lobes.visible is not None:
            light_arrays = (
                direct_lobes.visible[start:stop],
                direct_lobes.lights.direction,
                direct_lobes.lights.irradiance,
            )
            _add_triangles(frames[start:stop], normals, *light_arrays, bins)
        ray_range = ray_points_per_patch * start, ray_points_per_patch * stop
        range_points = ray_points.rows(slice(*ray_range))
        for rays in direct_lobes.rays:
            ray_list = build_ray_lists(rays, receivers, *ray_range)
            _add_ray_list(frames[start:stop], range_points, ray_list.first, ray_list.wi, ray_list.irradiance, bins)
        highlight_arrays = highlights.table_index[start:stop], highlights.gain[start:stop]
        _spread(bins, *highlight_arrays, highlights.tables, reflected_bins(), out[start:stop])

    for_ranges(fill, len(highlights.rows), _PATCHES_PER_RANGE)
    return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _mirror_bin(frame, n, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Return reflection symmetry and bin of a light direction, as a point with normal n reflects it."""
    t, b = frame[0], frame[1]
    mx, my, mz = t[1] * b[2] - t[2] * b[1], t[2] * b[0] - t[0] * b[2], t[0] * b[1] - t[1] * b[0]
    twice = np.float32(2) * (n[0] * dx + n[1] * dy + n[2] * dz)
    rx, ry, rz = twice * n[0] - dx, twice * n[1] - dy, twice * n[2] - dz
    up = max(mx * rx + my * ry + mz * rz, np.float32(0))
    x, y = -(t[0] * rx + t[1] * ry + t[2] * rz), -(b[0] * rx + b[1] * ry + b[2] * rz)
    reflection = np.int64(x < 0) + 2 * np.int64(y < 0)
    scale = np.float32(FINE_BINS_PER_RADIUS) / (np.float32(1) + up)
    i: Any = min(np.int64(scale * abs(x)), FINE_BINS_PER_RADIUS - 1)
    j: Any = min(np.int64(scale * abs(y)), FINE_BINS_PER_RADIUS - 1)
    if j > i:
        i, j, reflection = j, i, reflection + 4
    return reflection, i * (i + 1) // 2 + j


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _are_parallel(normals):  # type: ignore[no-untyped-def]
    for p in range(1, normals.shape[0]):
        n, m = normals[0], normals[p]
        if n[0] * m[0] + n[1] * m[1] + n[2] * m[2] < _PARALLEL_COSINE:
            return False
    return True


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_triangles(frames, normals, visible, direction, irradiance, bins):  # type: ignore[no-untyped-def]
    """Add the light triangles that are visible from the points of patches to bins.

    Args:
        frames: frames of the patches. (G, 2, 3). normals: normals of their points. (G, P, 3).
        visible: from these. (G, P, bytes) uint8
        direction, irradiance: directions and irradiance of the lights. (M, 3)
        bins: added to. (G, `NUM_REFLECTIONS`, `NUM_FINE_BINS`, 3)
    """
    num_points = normals.shape[1]
    point_weight = np.float32(1 / num_points)
    for g in range(bins.shape[0]):
        are_parallel = _are_parallel(normals[g])
        for p in range(1 if are_parallel else num_points):
            n = normals[g, p]
            for m in range(direction.shape[0]):
                dx, dy, dz = direction[m, 0], direction[m, 1], direction[m, 2]
                cosine = n[0] * dx + n[1] * dy + n[2] * dz
                num_visible = np.int64(0)
                for q in range(num_points):
                    if are_parallel or q == p:
                        num_visible += (visible[g, q, m >> 3] >> (m & 7)) & 1
                if num_visible == 0 or cosine <= 0:
                    continue
                reflection, b = _mirror_bin(frames[g], n, dx, dy, dz)
                for channel in range(3):
                    bins[g, reflection, b, channel] += point_weight * num_visible * cosine * irradiance[m, channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_ray_list(frames, points, first, wi, irradiance, bins):  # type: ignore[no-untyped-def]
    """Add listed rays, weighted by the cosine, to bins. points: points of the patches. wi: (3, K) local"""
    num_points = points.normal.shape[0] // bins.shape[0]
    point_weight = np.float32(1 / num_points)
    for p in range(points.normal.shape[0]):
        g, n, t = p // num_points, points.normal[p], points.tangent[p]
        bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
        for ray in range(first[p], first[p + 1]):
            x, y, z = wi[0, ray], wi[1, ray], wi[2, ray]
            dx, dy, dz = t[0] * x + bx * y + n[0] * z, t[1] * x + by * y + n[1] * z, t[2] * x + bz * y + n[2] * z
            reflection, b = _mirror_bin(frames[g], n, dx, dy, dz)
            for channel in range(3):
                bins[g, reflection, b, channel] += point_weight * irradiance[channel, ray]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _spread(bins, table_index, gain, tables, bin_permutation, out):  # type: ignore[no-untyped-def]
    """Apply the tables to binned light.

    Args:
        bins: light. (G, `NUM_REFLECTIONS`, `NUM_FINE_BINS`, 3). table_index: tables of each patch, −1 for none. (G,
            terms)
        gain: gain of each. (G, terms, 3). tables: T of all highlights. (tables, `NUM_FINE_BINS`, 1 or 3,
            `NUM_DIRECTION_BINS`)
        bin_permutation: see `reflected_bins`. out: added to. (G, 3, `NUM_DIRECTION_BINS`)
    """
    blue, spread_light = tables.shape[2] - 1, np.empty((3, out.shape[2]), np.float32)
    for g in range(out.shape[0]):
        for reflection in range(bins.shape[1]):
            spread_light[:] = 0
            for b in range(bins.shape[2]):
                if bins[g, reflection, b, 0] + bins[g, reflection, b, 1] + bins[g, reflection, b, 2] == 0:
                    continue
                for k in range(table_index.shape[1]):
                    if table_index[g, k] < 0:
                        continue
                    for channel in range(3):
                        row = tables[table_index[g, k], b, channel * blue // 2]
                        light = gain[g, k, channel] * bins[g, reflection, b, channel]
                        for outgoing_bin in range(row.shape[0]):
                            spread_light[channel, outgoing_bin] += light * row[outgoing_bin]
            for channel in range(3):
                for outgoing_bin in range(out.shape[2]):
                    out[g, channel, outgoing_bin] += spread_light[channel, bin_permutation[reflection, outgoing_bin]]
