"""Lights that reach a point: visible, and within the support of its fixed curves, in the point's local frame."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.angles import THETA_D, THETA_H, THETA_I, THETA_R
from relume.core.numba_options import NO_REFCOUNT
from relume.math.fast_math import acos_clamped
from relume.transport.gather_kernel import in_frame

F32 = NDArray[np.float32]

_HALF = np.float32(0.5)
_ZERO = np.float32(0)
# float32 holds an arc cosine near one to 5e-4
_SLACK = np.float32(1e-3)


class CurveSupport(NamedTuple):
    """Angles of curves, and the radians beyond which each curve is zero."""

    kinds: Shaped[NDArray[np.int64], " C"]
    limit: Shaped[F32, " C"]


class ListedLights(NamedTuple):
    """Memory for K entries: the lights of a range of points, in the points' local frames.

    Attributes:
        first: begin of each point's entries. light: of each entry; one more, as a kernel may write behind the last.
        wi, wo: local directions of each entry. Beyond K they are arbitrary.
    """

    first: Shaped[NDArray[np.int64], " ends"]
    light: Shaped[NDArray[np.int32], " capacity_and_one"]
    wi: Shaped[F32, "3 capacity"]
    wo: Shaped[F32, "3 capacity"]


def allocate_list(num_points: int, capacity: int) -> ListedLights:
    """Allocate memory for the entries of a number of points."""
    return ListedLights(
        np.empty(num_points + 1, np.int64), np.empty(capacity + 1, np.int32), *np.empty((2, 3, capacity), np.float32)
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def half_angle_reach(radius, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Return a bound of the half vector's rotation while wi rotates by `radius`, and cos θd.

    Args:
        radius: radians. ix, iy, iz: local wi. ox, oy, oz: local wo.

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
            _, cos_theta_d = half_angle_reach(radius[k], ix[k], iy[k], iz[k], ox, oy, oz)
            out[k] = acos_clamped(cos_theta_d) - _HALF * radius[k]
    elif kind == THETA_H:
        for k in range(ix.shape[0]):
            reach, cos_theta_d = half_angle_reach(radius[k], ix[k], iy[k], iz[k], ox, oy, oz)
            out[k] = acos_clamped(_HALF * (iz[k] + oz) / max(cos_theta_d, np.float32(1e-6))) - reach
    else:
        out[: ix.shape[0]] = 0


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def cull(support, radius, listed, begin, end, o, scratch):  # type: ignore[no-untyped-def]
    """Remove lights in [begin, end) for which a fixed curve is zero; write wo of the others and return their end.

    Args:
        support: `CurveSupport` of the fixed curves. radius: of each light, radians. listed: `ListedLights`.
        begin, end: of the list. o: local wo, a tuple. scratch: (2, ≥ end − begin)
    """
    light, wi, reach, nearest = listed.light, listed.wi, scratch[0], scratch[1]
    for k in range(support.kinds.shape[0]):
        limit = support.limit[k] + _SLACK
        if limit > np.float32(math.pi / 2) or not is_bounded(support.kinds[k]):
            continue
        num = end - begin
        for n in range(num):
            reach[n] = radius[light[begin + n]]
        x, y, z = wi[0, begin:end], wi[1, begin:end], wi[2, begin:end]
        angle_lower_bounds(support.kinds[k], reach[:num], x, y, z, o[0], o[1], o[2], nearest)
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
    for axis in range(3):
        listed.wo[axis, begin:end] = o[axis]
    return end


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def scale_by_axes(axes, wo, entry, out):  # type: ignore[no-untyped-def]
    """Multiply an entry's local wo by the axes of each curve.

    Args:
        axes: of the curves. (C, 3). wo: of `ListedLights`. entry: its index. out: written. (C, 3)
    """
    for k in range(axes.shape[0]):
        for axis in range(3):
            out[k, axis] = axes[k, axis] * wo[axis, entry]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def list_lights(points, wo, visible, directions, radius, support, start, scratch, listed):  # type: ignore[no-untyped-def]
    """List the visible lights of points [start, start + len(visible)) in their local frames.

    Args:
        points: `SurfacePoints`. wo: view directions. (n, 3) float32
        visible: light m of a point in bit m & 7 of byte m >> 3. (points, bytes) uint8
        directions: mean directions of the lights. (M, 3) float32
        radius: angular radius of each light about its direction, radians. (M,) float32
        support: `CurveSupport`. scratch: (2, M). listed: `ListedLights`, written.
    Returns:
        K, the number of entries.
    """
    light, wi, end = listed.light, listed.wi, np.int64(0)
    for row in range(visible.shape[0]):
        begin, p = end, start + row
        listed.first[row] = begin
        for eight in range(0, directions.shape[0], 8):
            bits = visible[row, eight >> 3]
            if bits == 0:  # true for long runs
                continue
            for k in range(min(8, directions.shape[0] - eight)):
                light[end] = eight + k  # overwritten if it is occluded: a branch is mispredicted at shadow edges
                end += (bits >> k) & 1
        b, o = in_frame(points.normal[p], points.tangent[p], wo[p])
        nx, ny, nz = points.normal[p, 0], points.normal[p, 1], points.normal[p, 2]
        tx, ty, tz = points.tangent[p, 0], points.tangent[p, 1], points.tangent[p, 2]
        for entry in range(begin, end):
            light_index = np.uint64(light[entry])
            x, y, z = directions[light_index, 0], directions[light_index, 1], directions[light_index, 2]
            wi[0, entry] = tx * x + ty * y + tz * z
            wi[1, entry] = b[0] * x + b[1] * y + b[2] * z
            wi[2, entry] = nx * x + ny * y + nz * z
        end = cull(support, radius, listed, begin, end, o, scratch)
    listed.first[visible.shape[0]] = end
    return end
