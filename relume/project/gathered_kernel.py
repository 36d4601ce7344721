"""Gather rays of points: directed, weighed, and listed with the light that they bring, or summed at once.

Loops that make the numbers of all rays of a point write one array each, so that they are vectors; what is looked up by
the cell that a ray hits comes after them.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.light.gather_rays import density_about_mirror, small_shifts_of
from relume.project.sent import square_of
from relume.trace.cell_tree import NO_CELL
from relume.uncounted import UNCOUNTED

_ZERO, _ONE, _TWO, _HALF = np.float32(0), np.float32(1), np.float32(2), np.float32(0.5)
_PI = np.float32(math.pi)
_EPSILON, _GROWTH = np.float32(1e-3), np.float32(1 + 1e3)  # of `relume.light.gather_rays`


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def in_frame(n, t, o):  # type: ignore[no-untyped-def]
    """Find the bitangent n × t of a shading frame, and direction o in the frame."""
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    ox = t[0] * o[0] + t[1] * o[1] + t[2] * o[2]
    oy = bx * o[0] + by * o[1] + bz * o[2]
    oz = n[0] * o[0] + n[1] * o[1] + n[2] * o[2]
    return (bx, by, bz), (ox, oy, oz)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _cosine_rays(rays, shift, x, y, z, square):  # type: ignore[no-untyped-def]
    """Direct the cosine rays of a point, as `cosine_ray` does. square: scratch. (rays,) each"""
    moved, cosine, sine = shift[0], shift[2], shift[3]
    for k in range(x.shape[0]):
        u = rays[k, 0] + moved
        u = u - _ONE if u >= _ONE else u
        square[k] = u + _ONE if u < _ZERO else u
    for k in range(x.shape[0]):
        x[k] = math.sqrt(square[k]) * (rays[k, 2] * cosine - rays[k, 3] * sine)
    for k in range(x.shape[0]):
        y[k] = math.sqrt(square[k]) * (rays[k, 3] * cosine + rays[k, 2] * sine)
    for k in range(x.shape[0]):
        z[k] = math.sqrt(_ONE - square[k])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _glossy_rays(rays, shift, o, x, y, z, away, twice):  # type: ignore[no-untyped-def]
    """Direct the glossy rays of a point, as `glossy_ray` does. away, twice: scratch. (rays,) each"""
    moved, grown, cosine, sine = shift[0], shift[1], shift[2], shift[3]
    ox, oy, oz = o
    for k in range(x.shape[0]):
        u, far = rays[k, 0] + moved, rays[k, 1] * grown
        far = far * np.float32(1 / 1001) if u >= _ONE else far
        far = far * _GROWTH if u < _ZERO else far
        away[k] = max(_ZERO, min(_EPSILON * (far - _ONE), _ONE))
    for k in range(x.shape[0]):
        x[k] = math.sqrt(away[k] * (_TWO - away[k])) * (rays[k, 2] * cosine - rays[k, 3] * sine)
    for k in range(x.shape[0]):
        y[k] = math.sqrt(away[k] * (_TWO - away[k])) * (rays[k, 3] * cosine + rays[k, 2] * sine)
    for k in range(x.shape[0]):  # so far half vectors: they turn into the directions
        twice[k] = _TWO * (ox * x[k] + oy * y[k] + oz * (_ONE - away[k]))
    for k in range(x.shape[0]):
        x[k] = twice[k] * x[k] - ox
    for k in range(x.shape[0]):
        y[k] = twice[k] * y[k] - oy
    for k in range(x.shape[0]):
        z[k] = twice[k] * (_ONE - away[k]) - oz


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _weights(num_cosine, x, y, z, o, weight):  # type: ignore[no-untyped-def]
    """Weigh all rays of a point, as `weight_of` does."""
    ox, oy, oz = o
    of_cosine, of_glossy = np.float32(num_cosine), np.float32(x.shape[0] - num_cosine)
    if of_glossy == _ZERO:
        weight[:] = _PI / of_cosine
        return
    for k in range(x.shape[0]):
        hx, hy, hz = x[k] + ox, y[k] + oy, z[k] + oz
        length = math.sqrt(hx * hx + hy * hy + hz * hz)
        cos_theta_h = min(hz / max(length, np.float32(1e-6)), _ONE)
        about_mirror = density_about_mirror(cos_theta_h, _HALF * length)
        cosine = max(z[k], _ZERO)  # below the horizon nothing is traced
        weight[k] = cosine / (of_cosine * cosine / _PI + of_glossy * about_mirror)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _direct(pattern, seed, o, local, weight):  # type: ignore[no-untyped-def]
    """Direct and weigh all rays of a point. o: local wo. local: written, and scratch. (5, rays) weight: (rays,)"""
    num = pattern.num_cosine
    of_cosine, of_glossy = small_shifts_of(pattern, seed)
    x, y, z, one, other = local[0], local[1], local[2], local[3], local[4]
    _cosine_rays(pattern.rays[:num], of_cosine, x[:num], y[:num], z[:num], one)
    if num < x.shape[0]:
        _glossy_rays(pattern.rays[num:], of_glossy, o, x[num:], y[num:], z[num:], one, other)
    _weights(num, x, y, z, o, weight)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _lobes_hit(links, lobe, rows, rays):  # type: ignore[no-untyped-def]
    """List the rays of a point that hit a lobe, without a branch that nobody could foretell; returns their number.

    Args:
        links: of the point. (rays,) lobe: of each cell. rows, rays: written, lobes and rays. (> rays,)
    """
    num = 0
    for ray in range(links.shape[0]):
        rows[num], rays[num] = lobe[links[ray]], ray
        num += rows[num] >= 0
    return num


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _square_hit(sent, row, n, t, b, x, y, z):  # type: ignore[no-untyped-def]
    """Find the square of a lobe that a local direction (x, y, z) looks at. n, t, b: frame of the point"""
    dx, dy, dz = t[0] * x + b[0] * y + n[0] * z, t[1] * x + b[1] * y + n[1] * z, t[2] * x + b[2] * y + n[2] * z
    return square_of(sent.frame, row, -dx, -dy, -dz)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _table_for(sent, num_cosine, weight):  # type: ignore[no-untyped-def]
    """Choose what a ray looks lobes up in: where most rays are about the mirror direction, what has no rings."""
    return sent.smooth if _TWO * np.float32(num_cosine) * weight < _PI else sent.table


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def list_gathered(  # type: ignore[no-untyped-def]
    points, wo, links, pattern, sent, start, stop, first, wi, out, irradiance
):
    """List the rays of points [start, stop) that hit a cell, in the points' local frames.

    Args:
        points: `Points`. wo: towards the viewer. (n, 3) float32
        links: cell that each ray hits. (n, rays) uint16. pattern: the rays' directions.
        sent: by cells, a `Sent`.
        start, stop: the points.
        first: written, where the rays of each point begin. (points + 1,) int64
        wi: written, local directions. (3, K) float32. out: written, local wo. (3, K) float32
        irradiance: written, w · L of each ray. (3, K) float32
    Returns:
        K, the number of rays.
    """
    most = links.shape[1]
    local, weights, place = np.empty((5, most), np.float32), np.empty(most, np.float32), np.empty(most, np.int64)
    scratch = np.empty(most + 1, np.int32), np.empty(most + 1, np.int64), local, weights, place
    return _list(points, wo, links, pattern, sent, start, stop, scratch, first, wi, out, irradiance)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _list(points, wo, links, pattern, sent, start, stop, scratch, first, wi, out, irradiance):  # type: ignore[no-untyped-def]
    """Do what `list_gathered` is for. scratch: `rows` and `rays` of `_lobes_hit`, `local` and `weight` of `_direct`,
    and where each ray is listed. (rays,)"""
    _, normal, tangent, seed, _ = points
    rows, rays, local, weights, place = scratch
    has_lobes, most, end = sent.table.shape[0] > 0, links.shape[1], 0
    for p in range(start, stop):
        first[p - start] = end
        n, t = normal[p], tangent[p]
        b, o = in_frame(n, t, wo[p])
        _direct(pattern, seed[p], o, local, weights)
        for ray in range(most):
            cell = links[p, ray]
            place[ray] = end
            if cell == NO_CELL:
                continue
            wi[0, end], wi[1, end], wi[2, end] = local[0, ray], local[1, ray], local[2, ray]
            out[0, end], out[1, end], out[2, end] = o[0], o[1], o[2]
            for channel in range(3):
                irradiance[channel, end] = weights[ray] * sent.even[cell, channel]
            end += 1
        for which in range(_lobes_hit(links[p], sent.lobe, rows, rays) if has_lobes else 0):
            row, ray = rows[which], rays[which]
            square = _square_hit(sent, row, n, t, b, local[0, ray], local[1, ray], local[2, ray])
            table = _table_for(sent, pattern.num_cosine, weights[ray])
            for channel in range(3):
                value = sent.scale[row, channel] * table[row, square, channel]
                irradiance[channel, place[ray]] += weights[ray] * value
    first[stop - start] = end
    return end


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def sum_gathered(points, wo, links, pattern, sent, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the light of the rays of points [start, stop): what `list_gathered` lists, where directions do not matter.

    Args:
        points, wo, links, pattern, sent, start, stop: as there.
        out: Σ w · L, written. (points, 3) float32
    """
    most = links.shape[1]
    local, weights = np.empty((5, most), np.float32), np.empty(most, np.float32)
    scratch = np.empty(most + 1, np.int32), np.empty(most + 1, np.int64), local, weights
    _sum(points, wo, links, pattern, sent, start, stop, scratch, out)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _sum(points, wo, links, pattern, sent, start, stop, scratch, out):  # type: ignore[no-untyped-def]
    """Do what `sum_gathered` is for. scratch: as of `_list`, but for the last."""
    _, normal, tangent, seed, _ = points
    rows, rays, local, weights = scratch
    has_lobes, most = sent.table.shape[0] > 0, links.shape[1]
    for p in range(start, stop):
        n, t = normal[p], tangent[p]
        b, o = in_frame(n, t, wo[p])
        _direct(pattern, seed[p], o, local, weights)
        red = green = blue = np.float32(0)
        for ray in range(most):
            cell, weight = links[p, ray], weights[ray]
            red += weight * sent.even[cell, 0]
            green += weight * sent.even[cell, 1]
            blue += weight * sent.even[cell, 2]
        for which in range(_lobes_hit(links[p], sent.lobe, rows, rays) if has_lobes else 0):
            row, ray = rows[which], rays[which]
            square = _square_hit(sent, row, n, t, b, local[0, ray], local[1, ray], local[2, ray])
            weight, table = weights[ray], _table_for(sent, pattern.num_cosine, weights[ray])
            red += weight * sent.scale[row, 0] * table[row, square, 0]
            green += weight * sent.scale[row, 1] * table[row, square, 1]
            blue += weight * sent.scale[row, 2] * table[row, square, 2]
        out[p - start, 0], out[p - start, 1], out[p - start, 2] = red, green, blue
