"""What places of a BTF send: by kernels, for brute force; and place by place in NumPy, the oracle of all kernels."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.btf.eigen import F32, EigenBtf
from relume.btf.parallax import height_seen, height_seen_numpy, slant_of, slants
from relume.btf.rings import taps, taps_numpy
from relume.uncounted import UNCOUNTED

F64 = NDArray[np.float64]

_BESIDE = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])


def seen_numpy(found: EigenBtf, places: F64, wo: F64) -> F64:
    """The mean over places of what they send to an eye of light from each side in which the BTF is known.

    Args:
        found: the BTF. wo: to the eye, in the texture's frame, unit. (3,)
        places: column and row, in texels of the finest level, from the middle of the first. (n, 2)
    Returns:
        (L, 3) float64, the cosine of the light in it
    """
    size, sides = np.array(found.size[::-1]), slants(found.rings)
    slant = wo[:2] / max(wo[2], np.hypot(wo[0], wo[1]) / np.tan(found.rings.theta[-1]))
    height = np.array([height_seen_numpy(found.height, (one + 0.5) / size, slant) for one in places])
    view, of_view, _ = taps_numpy(found.rings, wo[None])
    seen = np.zeros((found.rings.num_directions, 3))
    for side, share in zip(view[0], of_view[0], strict=True):
        at = places + height[:, None] * (slant - sides[side]) * [1, -1] * size
        first = np.floor(at).astype(int)
        near = np.abs(1 - _BESIDE - (at - first)[:, None]).prod(axis=2) / len(places)
        column, row = np.moveaxis((first[:, None] + _BESIDE) % size, 2, 0)
        seen += share * found.sum_from(side, (row * size[0] + column).ravel(), near.ravel())
    return seen


def sent_numpy(found: EigenBtf, seen: F64, wi: F64) -> F64:
    """What is sent of light from some directions, one unit of irradiance across each.

    Args:
        found: the BTF. seen: from `seen_numpy`. wi: in the texture's frame, unit. (m, 3)
    Returns:
        (m, 3) float64
    """
    light, of_light, left = taps_numpy(found.rings, wi)
    return np.asarray(np.einsum("mk,m,mkc->mc", of_light, left, seen[light]))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _add_texels(size, u, v, share, cluster, weight, slot_of, slots, factors):  # type: ignore[no-untyped-def]
    """Add the four texels about a place to the factors of their clusters' means and components.

    Args:
        size: height and width. u, v: the place, in texels from the middle of the first. share: of the place.
        cluster, weight: of the texels. slot_of: row of `factors` of each cluster, below 0 where it has none yet.
        slots: clusters that have one; as many are filled as the last entry says.
    """
    left, upper = math.floor(u), math.floor(v)
    for corner in range(4):
        right, down = corner & 1, corner >> 1
        near = share * abs(1 - right - (u - left)) * abs(1 - down - (v - upper))
        texel = (np.int64(upper) + down) % size[0] * size[1] + (np.int64(left) + right) % size[1]
        k = cluster[texel]
        if slot_of[k] < 0:
            slot_of[k] = slots[-1]
            slots[slots[-1]] = k
            factors[slots[-1]] = 0
            slots[-1] += 1
        row = factors[slot_of[k]]
        row[0] += near
        for j in range(weight.shape[1]):
            row[1 + j] += near * weight[texel, j]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _seen(rings, side, height, size, cluster, weight, tables, places, wo, out):  # type: ignore[no-untyped-def]
    """Do as `seen` of its arrays. side: slants of the directions. size: height and width in texels."""
    lowest, highest = height.min(), height.max()
    view, of_view = np.empty(4, np.int32), np.empty(4, np.float32)
    slot_of, slots = np.full(256, -1, np.int64), np.empty(4 * places.shape[1] + 1, np.int64)
    factors, total = np.empty((len(slots), tables.shape[2]), np.float32), np.empty(tables.shape[3:], np.float32)
    at, width = np.empty(places.shape[1], np.float32), np.float32(size[1])
    rows = np.float32(size[0])
    for p in range(len(places)):
        total[:] = 0
        taps(rings, wo[p, 0], wo[p, 1], wo[p, 2], view, of_view)
        slant = slant_of(rings, wo[p, 0], wo[p, 1], wo[p, 2])
        for k in range(len(at)):
            u, v = (places[p, k, 0] + 0.5) / size[1], (places[p, k, 1] + 0.5) / size[0]
            at[k] = height_seen(
                height, lowest, highest, np.float32(u - math.floor(u)), np.float32(v - math.floor(v)), slant
            )
        for one in range(4):
            if of_view[one] == 0:
                continue
            side_of, slots[-1] = view[one], 0
            sx, sy = slant[0] - side[side_of, 0], slant[1] - side[side_of, 1]
            for k in range(len(at)):
                u, v = places[p, k, 0] + at[k] * sx * width, places[p, k, 1] - at[k] * sy * rows
                _add_texels(
                    size, u, v, of_view[one] / len(at), cluster[side_of], weight[side_of], slot_of, slots, factors
                )
            for row in range(slots[-1]):
                table = tables[side_of, slots[row]]
                slot_of[slots[row]] = -1
                for j in range(table.shape[0]):
                    factor = factors[row, j]
                    for channel in range(3):
                        for light in range(table.shape[2]):
                            total[channel, light] += factor * table[j, channel, light]
        for light in range(total.shape[1]):
            for channel in range(3):
                out[p, light, channel] = total[channel, light]


def seen(found: EigenBtf, tables: F32, places: F64, wo: F64) -> F32:
    """Do as `seen_numpy` of many points at once.

    Args:
        found: the BTF. tables: of it, see `EigenBtf.tables`.
        wo: to the eye, above the horizon. (n, 3). places: of each point. (n, places, 2)
    Returns:
        (n, L, 3) float32
    """
    out = np.empty((len(wo), found.rings.num_directions, 3), np.float32)
    _seen(
        found.rings, slants(found.rings), found.height, found.size, found.cluster, found.weight, tables, places,
        wo.astype(np.float32), out,
    )  # fmt: skip
    return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _sent(rings, seen, axes, of, wi, out):  # type: ignore[no-untyped-def]
    """Do as `sent` of its arrays."""
    index, weight = np.empty(4, np.int32), np.empty(4, np.float32)
    for m in range(len(wi)):
        p, x, y, z = of[m], np.float32(wi[m, 0]), np.float32(wi[m, 1]), np.float32(wi[m, 2])
        tx, ty = axes[p, 0, 0] * x + axes[p, 0, 1] * y, axes[p, 1, 0] * x + axes[p, 1, 1] * y
        left = taps(rings, np.float32(tx), np.float32(ty), z, index, weight)
        for channel in range(3):
            total = np.float32(0)
            for k in range(4):
                total += weight[k] * seen[p, index[k], channel]
            out[m, channel] = left * total


def sent(found: EigenBtf, seen: F32, axes: F64, of: NDArray[np.int64], wi: F64) -> F64:
    """Do as `sent_numpy` of many points at once.

    Args:
        found: the BTF. seen: from `seen`. (n, L, 3)
        axes: of the texture, in the frames of the points. (n, 2, 2)
        of: point of each direction. (m,). wi: in the frames of their points, unit. (m, 3)
    Returns:
        (m, 3) float64
    """
    out = np.empty((len(wi), 3))
    _sent(found.rings, seen, axes, of, np.ascontiguousarray(wi, np.float64), out)
    return out
