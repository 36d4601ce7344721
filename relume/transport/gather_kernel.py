"""Final gathering: kernels that generate and weight gather rays, and list them with their radiance or sum them.

Loops over all rays of a point write one array each, so that the compiler vectorizes them. Lookups by the patch that a
ray hits follow in separate loops.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.gather_rays import glossy_pdf, lattice_offsets
from relume.transport.outgoing_patch_light import bin_of

F32 = NDArray[np.float32]

_ZERO, _ONE, _TWO, _HALF = np.float32(0), np.float32(1), np.float32(2), np.float32(0.5)
_PI = np.float32(math.pi)
_EPSILON, _GROWTH = np.float32(1e-3), np.float32(1 + 1e3)  # of `relume.raytrace.gather_rays`


class GatherScratch(NamedTuple):
    """Scratch memory of a point's rays.

    Attributes:
        hits: rays that hit a patch; one more. rows, entries: lobes that are hit, and the hits among these rays; one
            more. local: directions, and for `_generate_rays`. weights: of the rays.
    """

    hits: Shaped[NDArray[np.int64], " rays_and_one"]
    rows: Shaped[NDArray[np.int32], " rays_and_one"]
    entries: Shaped[NDArray[np.int64], " rays_and_one"]
    local: Shaped[F32, "5 rays"]
    weights: Shaped[F32, " rays"]


def allocate_scratch(num_rays: int) -> GatherScratch:
    """Allocate scratch memory for a number of rays per point."""
    (hits, entries), rows = np.empty((2, num_rays + 1), np.int64), np.empty(num_rays + 1, np.int32)
    return GatherScratch(hits, rows, entries, np.empty((5, num_rays), np.float32), np.empty(num_rays, np.float32))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def in_frame(n, t, o):  # type: ignore[no-untyped-def]
    """Return the bitangent n × t of a shading frame, and direction o in this frame."""
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    ox = t[0] * o[0] + t[1] * o[1] + t[2] * o[2]
    oy = bx * o[0] + by * o[1] + bz * o[2]
    oz = n[0] * o[0] + n[1] * o[1] + n[2] * o[2]
    return (bx, by, bz), (ox, oy, oz)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _cosine_rays(rays, shift, x, y, z, radius_squared):  # type: ignore[no-untyped-def]
    """Generate the cosine rays of a point, as `cosine_ray` does. radius_squared: scratch. (rays,) each"""
    offset, cosine, sine = shift[0], shift[2], shift[3]
    for k in range(x.shape[0]):
        u = rays[k, 0] + offset
        u = u - _ONE if u >= _ONE else u
        radius_squared[k] = u + _ONE if u < _ZERO else u
    for k in range(x.shape[0]):
        x[k] = math.sqrt(radius_squared[k]) * (rays[k, 2] * cosine - rays[k, 3] * sine)
    for k in range(x.shape[0]):
        y[k] = math.sqrt(radius_squared[k]) * (rays[k, 3] * cosine + rays[k, 2] * sine)
    for k in range(x.shape[0]):
        z[k] = math.sqrt(_ONE - radius_squared[k])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _glossy_rays(rays, shift, o, x, y, z, distance, twice_cosine):  # type: ignore[no-untyped-def]
    """Generate the glossy rays of a point, as `glossy_ray` does. distance, twice_cosine: scratch. (rays,) each"""
    offset, scale, cosine, sine = shift[0], shift[1], shift[2], shift[3]
    ox, oy, oz = o
    for k in range(x.shape[0]):
        u, far = rays[k, 0] + offset, rays[k, 1] * scale
        far = far * np.float32(1 / 1001) if u >= _ONE else far
        far = far * _GROWTH if u < _ZERO else far
        distance[k] = max(_ZERO, min(_EPSILON * (far - _ONE), _ONE))
    for k in range(x.shape[0]):
        x[k] = math.sqrt(distance[k] * (_TWO - distance[k])) * (rays[k, 2] * cosine - rays[k, 3] * sine)
    for k in range(x.shape[0]):
        y[k] = math.sqrt(distance[k] * (_TWO - distance[k])) * (rays[k, 3] * cosine + rays[k, 2] * sine)
    for k in range(x.shape[0]):  # x, y, z are half vectors so far; reflect o about them
        twice_cosine[k] = _TWO * (ox * x[k] + oy * y[k] + oz * (_ONE - distance[k]))
    for k in range(x.shape[0]):
        x[k] = twice_cosine[k] * x[k] - ox
    for k in range(x.shape[0]):
        y[k] = twice_cosine[k] * y[k] - oy
    for k in range(x.shape[0]):
        z[k] = twice_cosine[k] * (_ONE - distance[k]) - oz


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _weights(num_cosine, x, y, z, o, weight):  # type: ignore[no-untyped-def]
    """Weight all rays of a point, as `ray_weight` does."""
    ox, oy, oz = o
    num_cosine_rays, num_glossy_rays = np.float32(num_cosine), np.float32(x.shape[0] - num_cosine)
    if num_glossy_rays == _ZERO:
        weight[:] = _PI / num_cosine_rays
        return
    for k in range(x.shape[0]):
        hx, hy, hz = x[k] + ox, y[k] + oy, z[k] + oz
        length = math.sqrt(hx * hx + hy * hy + hz * hz)
        cos_theta_h = min(hz / max(length, np.float32(1e-6)), _ONE)
        pdf = glossy_pdf(cos_theta_h, _HALF * length)
        cosine = max(z[k], _ZERO)  # no rays are traced below the horizon
        weight[k] = cosine / (num_cosine_rays * cosine / _PI + num_glossy_rays * pdf)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _generate_rays(pattern, seed, o, local, weight):  # type: ignore[no-untyped-def]
    """Generate and weight all rays of a point. o: local wo. local: written, with scratch. (5, rays) weight: (rays,)"""
    num = pattern.num_cosine
    cosine_shift, glossy_shift = lattice_offsets(pattern, seed)
    x, y, z, scratch_a, scratch_b = local[0], local[1], local[2], local[3], local[4]
    _cosine_rays(pattern.rays[:num], cosine_shift, x[:num], y[:num], z[:num], scratch_a)
    if num < x.shape[0]:
        _glossy_rays(pattern.rays[num:], glossy_shift, o, x[num:], y[num:], z[num:], scratch_a, scratch_b)
    _weights(num, x, y, z, o, weight)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _patches_hit(gather_hits, hits):  # type: ignore[no-untyped-def]
    """List the rays of a point that hit a patch; return their number. Avoids unpredictable branches.

    Args:
        gather_hits: patch of each ray of the point. (rays,) hits: rays, written. (> rays,)
    """
    num = 0
    for ray in range(gather_hits.shape[0]):
        hits[num] = ray
        num += gather_hits[ray] != NO_PATCH
    return num


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _lobes_hit(gather_hits, hits, lobe, rows, entries):  # type: ignore[no-untyped-def]
    """List the hits at patches with a lobe; return their number. Avoids unpredictable branches.

    Args:
        gather_hits: as in `_patches_hit`. hits: from it. (hits,) lobe: lobe of each patch.
        rows, entries: lobes, and indices in `hits`, written. (> hits,)
    """
    num = 0
    for k in range(hits.shape[0]):
        rows[num], entries[num] = lobe[gather_hits[hits[k]]], k
        num += rows[num] >= 0
    return num


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _bin_hit(outgoing, row, n, t, b, x, y, z):  # type: ignore[no-untyped-def]
    """Return the direction bin of a lobe toward −(x, y, z), a local direction. n, t, b: frame of the point"""
    dx, dy, dz = t[0] * x + b[0] * y + n[0] * z, t[1] * x + b[1] * y + n[1] * z, t[2] * x + b[2] * y + n[2] * z
    return bin_of(outgoing.frame, row, -dx, -dy, -dz)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _table_for(outgoing, num_cosine, weight):  # type: ignore[no-untyped-def]
    """Select the lobe table of a ray: the smooth one where rays concentrate about the mirror direction."""
    return outgoing.smooth if _TWO * np.float32(num_cosine) * weight < _PI else outgoing.table


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def list_gather_rays(points, wo, gather_hits, pattern, outgoing, start, stop, scratch, listed):  # type: ignore[no-untyped-def]
    """List the rays of points [start, stop) that hit a patch, in the points' local frames.

    Args:
        points: `SurfacePoints`. wo: view directions. (n, 3) float32
        gather_hits: patch that each ray hits. (n, rays) uint16. pattern: the rays' directions.
        outgoing: outgoing radiance of the patches, an `OutgoingLight`. start, stop: range of points.
        scratch: from `allocate_scratch`. listed: `ListedRays`, written.
    Returns:
        K, the number of rays.
    """
    (_, normal, tangent, seed, _), (first, wi, out, irradiance) = points, listed
    hits, rows, entries, local, weights = scratch
    has_lobes, isotropic, end = outgoing.table.shape[0] > 0, outgoing.isotropic, 0
    for p in range(start, stop):
        first[p - start] = begin = end
        n, t = normal[p], tangent[p]
        b, o = in_frame(n, t, wo[p])
        _generate_rays(pattern, seed[p], o, local, weights)
        num = _patches_hit(gather_hits[p], hits)
        end += num
        for axis in range(3):
            out[axis, begin:end] = o[axis]
            for k in range(num):
                wi[axis, begin + k] = local[axis, hits[k]]
        for k in range(num):
            patch, weight = gather_hits[p, hits[k]], weights[hits[k]]
            irradiance[0, begin + k] = weight * isotropic[patch, 0]
            irradiance[1, begin + k] = weight * isotropic[patch, 1]
            irradiance[2, begin + k] = weight * isotropic[patch, 2]
        for k in range(_lobes_hit(gather_hits[p], hits[:num], outgoing.lobe, rows, entries) if has_lobes else 0):
            row, ray = rows[k], hits[entries[k]]
            bin_index = _bin_hit(outgoing, row, n, t, b, local[0, ray], local[1, ray], local[2, ray])
            table = _table_for(outgoing, pattern.num_cosine, weights[ray])
            for channel in range(3):
                value = outgoing.scale[row, channel] * table[row, bin_index, channel]
                irradiance[channel, begin + entries[k]] += weights[ray] * value
    first[stop - start] = end
    return end


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def sum_gather_rays(points, gather_hits, pattern, outgoing, start, stop, scratch, out):  # type: ignore[no-untyped-def]
    """Sum the light of the cosine rays of points [start, stop): irradiance, for which glossy rays are not needed.

    Args:
        points, gather_hits, pattern, outgoing, start, stop, scratch: as in `list_gather_rays`.
        out: π / n Σ L, written. (points, 3) float32
    """
    _, normal, tangent, seed, _ = points
    hits, rows, entries, local, _ = scratch
    num, has_lobes = pattern.num_cosine, outgoing.table.shape[0] > 0
    weight = _PI / np.float32(num)
    for p in range(start, stop):
        red = green = blue = np.float32(0)
        for ray in range(num):
            patch = gather_hits[p, ray]
            red += outgoing.isotropic[patch, 0]
            green += outgoing.isotropic[patch, 1]
            blue += outgoing.isotropic[patch, 2]
        num_lobes = 0
        if has_lobes:
            num_hits = _patches_hit(gather_hits[p, :num], hits)
            num_lobes = _lobes_hit(gather_hits[p], hits[:num_hits], outgoing.lobe, rows, entries)
        if num_lobes > 0:
            n, t = normal[p], tangent[p]
            b, _ = in_frame(n, t, n)
            cosine_shift, _ = lattice_offsets(pattern, seed[p])
            x, y, z = local[0, :num], local[1, :num], local[2, :num]
            _cosine_rays(pattern.rays[:num], cosine_shift, x, y, z, local[3])
            for k in range(num_lobes):
                row, ray = rows[k], hits[entries[k]]
                bin_index = _bin_hit(outgoing, row, n, t, b, x[ray], y[ray], z[ray])
                red += outgoing.scale[row, 0] * outgoing.table[row, bin_index, 0]
                green += outgoing.scale[row, 1] * outgoing.table[row, bin_index, 1]
                blue += outgoing.scale[row, 2] * outgoing.table[row, bin_index, 2]
        out[p - start, 0], out[p - start, 1], out[p - start, 2] = weight * red, weight * green, weight * blue
