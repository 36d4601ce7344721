"""Lights that reach a point: visible, and within the support of its fixed curves, in the point's local frame."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.brdf.angles import THETA_D, THETA_H, THETA_I, THETA_R
from relume.core.numba_options import NO_REFCOUNT
from relume.math.fast_math import acos_clamped

_HALF = np.float32(0.5)
_ZERO = np.float32(0)
# float32 holds an arc cosine near one to 5e-4
_SLACK = np.float32(1e-3)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _half_angle_reach(radius, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Return a bound of the half vector's rotation while wi rotates by `radius`, and cos θd.

    The half vector is the middle of an arc of length 2θd with one fixed end. Moving the other end by dε moves the
    middle by at most dε / (2 cos θd), and θd by dε / 2.
    """
    x, y, z = ix + ox, iy + oy, iz + oz
    cos_theta_d = min(_HALF * math.sqrt(x * x + y * y + z * z), np.float32(1))
    sin_theta_d = math.sqrt(max(_ZERO, np.float32(1) - cos_theta_d * cos_theta_d))
    # cos(θd + radius / 2), rounded down: cos ε ≥ 1 − ε²/2, sin ε ≤ ε
    half = _HALF * radius
    farthest = cos_theta_d * (np.float32(1) - _HALF * half * half) - sin_theta_d * half
    return half / max(farthest, np.float32(1e-6)), cos_theta_d


@nb.njit(nogil=True, cache=True, forceinline=True, **NO_REFCOUNT)
def is_bounded(kind):  # type: ignore[no-untyped-def]
    """Return True if `angle_lower_bounds` bounds an angle."""
    return kind in (THETA_I, THETA_R, THETA_D, THETA_H)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def angle_lower_bounds(kind, radius, ix, iy, iz, ox, oy, oz, out):  # type: ignore[no-untyped-def]
    """Bound γ(wi', wo) from below over all wi' within `radius` of wi; zero for angles without a bound.

    Args:
        kind: an `Angle`. radius: radians. (n,) float32
        ix, iy, iz: local wi. (n,) float32. ox, oy, oz: local wo, scalars.
        out: radians, written. (n,) float32
    """
    # one loop per angle, as in relume.brdf.angles
    if kind == THETA_I:
        for k in range(ix.shape[0]):
            out[k] = acos_clamped(iz[k]) - radius[k]
    elif kind == THETA_R:
        for k in range(ix.shape[0]):
            out[k] = acos_clamped(iz[k] * oz - ix[k] * ox - iy[k] * oy) - radius[k]
    elif kind == THETA_D:
        for k in range(ix.shape[0]):
            _, cos_theta_d = _half_angle_reach(radius[k], ix[k], iy[k], iz[k], ox, oy, oz)
            out[k] = acos_clamped(cos_theta_d) - _HALF * radius[k]
    elif kind == THETA_H:
        for k in range(ix.shape[0]):
            reach, cos_theta_d = _half_angle_reach(radius[k], ix[k], iy[k], iz[k], ox, oy, oz)
            out[k] = acos_clamped(_HALF * (iz[k] + oz) / max(cos_theta_d, np.float32(1e-6))) - reach
    else:
        out[: ix.shape[0]] = 0


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def cull(kinds, support, radius, light, wi, begin, end, ox, oy, oz, reach, nearest):  # type: ignore[no-untyped-def]
    """Remove lights in [begin, end) for which a fixed curve is zero; return the new end.

    Args:
        kinds: angles of fixed curves. support: angle beyond which each is zero, radians. (D,)
        radius: radius of each light, radians. light: listed lights. wi: local unit directions to these. (3, K)
        begin, end: range of the list. ox, oy, oz: local wo. reach, nearest: scratch. (≥ end − begin,)
    """
    for k in range(kinds.shape[0]):
        limit = support[k] + _SLACK
        if limit > np.float32(math.pi / 2) or not is_bounded(kinds[k]):
            continue
        num = end - begin
        for n in range(num):
            reach[n] = radius[light[begin + n]]
        x, y, z = wi[0, begin:end], wi[1, begin:end], wi[2, begin:end]
        angle_lower_bounds(kinds[k], reach[:num], x, y, z, ox, oy, oz, nearest)
        farthest = _ZERO
        for n in range(num):
            farthest = max(farthest, nearest[n])
        if farthest <= limit:
            continue
        write_index = begin
        for n in range(num):
            light[write_index] = light[begin + n]
            wi[0, write_index], wi[1, write_index], wi[2, write_index] = x[n], y[n], z[n]
            write_index += nearest[n] <= limit
        end = write_index
    return end


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def list_lights(  # type: ignore[no-untyped-def]
    normal, tangent, wo, visible, directions, radius, kinds, support, start, stop, first, light, wi, out
):
    """List the lights of points [start, stop) in their local frames.

    Args:
        normal, tangent: shading frames. wo: view directions. (n, 3) float32
        visible: light m of a point in bit m & 7 of byte m >> 3. (n, bytes) uint8
        directions: mean directions of the lights. (M, 3) float32
        radius: angular radius of each light about its direction, radians. (M,) float32
        kinds: angles of the curves. support: radians beyond which each is zero. (C,) float32
        start, stop: range of points.
        first: begin of each point's entries, written. (points + 1,) int64
        light: light of each entry, written. (K + 1,) int32
        wi: local directions, written. (3, K) float32. out: local wo, written. (3, K) float32
    Returns:
        K, the number of entries.
    """
    reach, nearest = np.empty(len(directions), np.float32), np.empty(len(directions), np.float32)
    return _list(
        normal, tangent, wo, visible, directions, radius, kinds, support, start, stop, (reach, nearest),
        first, light, wi, out,
    )  # fmt: skip


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _list(  # type: ignore[no-untyped-def]
    normal, tangent, wo, visible, directions, radius, kinds, support, start, stop, scratch, first, light, wi, out
):
    """Implement `list_lights`. scratch: scratch of `cull`. (M,) each"""
    num_lights, (reach, nearest) = directions.shape[0], scratch
    end = np.int64(0)
    for p in range(start, stop):
        begin = end
        first[p - start] = begin
        for eight in range(0, num_lights, 8):
            bits = visible[p, eight >> 3]
            if bits == 0:  # true for long runs
                continue
            for k in range(min(8, num_lights - eight)):
                light[end] = eight + k  # overwritten if it is occluded: a branch is mispredicted at shadow edges
                end += (bits >> k) & 1
        nx, ny, nz = normal[p, 0], normal[p, 1], normal[p, 2]
        tx, ty, tz = tangent[p, 0], tangent[p, 1], tangent[p, 2]
        bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        for n in range(begin, end):
            light_index = np.uint64(light[n])
            x, y, z = directions[light_index, 0], directions[light_index, 1], directions[light_index, 2]
            wi[0, n] = tx * x + ty * y + tz * z
            wi[1, n] = bx * x + by * y + bz * z
            wi[2, n] = nx * x + ny * y + nz * z
        ox = tx * wo[p, 0] + ty * wo[p, 1] + tz * wo[p, 2]
        oy = bx * wo[p, 0] + by * wo[p, 1] + bz * wo[p, 2]
        oz = nx * wo[p, 0] + ny * wo[p, 1] + nz * wo[p, 2]
        end = cull(kinds, support, radius, light, wi, begin, end, ox, oy, oz, reach, nearest)
        out[0, begin:end], out[1, begin:end], out[2, begin:end] = ox, oy, oz
    first[stop - start] = end
    return end
