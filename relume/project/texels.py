"""What surfaces send whose every texel has a BRDF of its own: the sum over light, texel by texel.

    L(x, ωo) = Σ_v hat_v(ωo) Σ_j α_vj(x) Σ_l E_vkj(l) a_l(x),   a_l = Σ_s w_s hat_l(ω_s)

where a is all light that arrives at a place (`relume.project.arrived`). Where relief is known, x is from each side v
where the same of it is seen (`relume.btf.parallax`).
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.arcs import log2_above_one
from relume.brdf.terms.btf import Texels
from relume.btf.parallax import height_seen, slant_of, slants
from relume.btf.rings import taps
from relume.btf.sent import seen_numpy, sent_numpy
from relume.light.triangles import TriangleLights
from relume.project.arrived import arrived_rows, into_texture, texture_axes
from relume.project.receivers import Receivers
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_LEAST_COSINE = np.float32(1e-3)
_TEXEL = np.float32(0.5)  # side of the texels for a footprint, in footprints: a mean between four is twice as wide
_MOST_PLACES = 4  # along a footprint
_APART = np.float32(1.5)  # texels, between them at most
_LONGEST = np.float32(3)  # footprint, in widths: of longer ones coarser texels are summed


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _beside(place, count):  # type: ignore[no-untyped-def]
    """Find the two texels of a row beside a place within [0, 1], and the share of the second."""
    x: Any = place * np.float32(count) - np.float32(0.5)
    # a floor, which would be a call; whatever the place is
    low: Any = min(max(np.int32(x + np.float32(1)) - 1, np.int32(-1)), np.int32(count - 1))
    share = np.float32(x - np.float32(low))
    return (low if low >= 0 else count - 1), (low + 1 if low + 1 < count else 0), share


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def texels_about(levels, u, v, footprint, texel, share):  # type: ignore[no-untyped-def]
    """Find the texels about a place, of the two levels about a footprint.

    Args:
        levels: of the BTF. u, v: the place, in repeats. footprint: side of it, in repeats.
        texel: their numbers, written. (8,) int32. share: of each, written. (8,) float32
    Returns:
        How many there are: four of each level that has a share.
    """
    level = level_of(footprint, np.float32(max(levels[0, 1], levels[0, 2])))
    u, v = np.float32(u - math.floor(u)), np.float32(v - math.floor(v))  # remainders of integers are slow
    return texels_at(levels, u, v, level, texel, share)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def level_of(footprint, finest):  # type: ignore[no-untyped-def]
    """Level of halvings for a footprint, however many there are. finest: side of the finest, in texels."""
    return log2_above_one(max(_TEXEL * footprint * finest, np.float32(1)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def texels_at(levels, u, v, level, texel, share):  # type: ignore[no-untyped-def]
    """Do as `texels_about`.

    Args:
        levels, texel, share: as there. u, v: shares of a repeat. level: between two, see `level_of`.
    """
    coarsest = levels.shape[0] - 1
    near: Any = min(level, np.float32(coarsest))
    lower = np.int64(near)
    between = np.float32(near - np.float32(lower))
    num = 0
    for step in range(2):
        of_level = between if step == 1 else np.float32(1) - between
        if of_level <= 0 or lower + step > coarsest:
            continue
        first, height, width = levels[lower + step, 0], levels[lower + step, 1], levels[lower + step, 2]
        left, right, fx = _beside(u, width)
        upper, below, fy = _beside(v, height)
        upper, below = first + upper * width, first + below * width
        texel[num], texel[num + 1], texel[num + 2], texel[num + 3] = (
            upper + left,
            upper + right,
            below + left,
            below + right,
        )
        top, bottom = of_level * (np.float32(1) - fy), of_level * fy
        share[num], share[num + 1] = top * (np.float32(1) - fx), top * fx
        share[num + 2], share[num + 3] = bottom * (np.float32(1) - fx), bottom * fx
        num += 4
    return num


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def along_footprint(footprint, up, finest):  # type: ignore[no-untyped-def]
    """Find places whose texels, summed, are as long as a footprint, which a slant makes longer than wide.

    Box and tent of texels of side t have a variance of t²/4 about a place, n places d apart one of d² (n² − 1) / 12:
    both together are that of the footprint's length, a²/12.

    Args:
        footprint: side of the square of its area, in repeats. up: cosine of the slant. finest: see `level_of`.
    Returns:
        How many places; how far apart; the footprint's width, or what stands for it.
    """
    slanted = np.float32(math.sqrt(max(up, _LEAST_COSINE)))
    length: Any = footprint / slanted
    width: Any = max(footprint * slanted, length / _LONGEST)
    texel: Any = max(_TEXEL * width, np.float32(1) / finest)
    beyond: Any = length * length - np.float32(3) * texel * texel
    if beyond <= 0:
        return 1, np.float32(0), width
    num: Any = min(max(np.int64(math.ceil(length / (_APART * texel))), 2), _MOST_PLACES)
    return num, np.float32(math.sqrt(beyond / np.float32(num * num - 1))), width


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _add_weights(cluster, weight, view, texel, share, num, part, num_found, found, sums):  # type: ignore[no-untyped-def]
    """Add the weights of texels, seen from one side, by their clusters.

    Args:
        cluster, weight: of the BTF. view: the side. texel, share: see `texels_about`. num: of them.
        part: that they are of all texels.
        num_found: clusters that there are yet. found: these, written. (≥ num_found + num,) int32
        sums: of their means' and components' weights, written. (≥ num_found + num, ≥ 1 + C)
    Returns:
        How many clusters there are.
    """
    for k in range(num):
        at, w = texel[k], part * share[k]
        of = cluster[view, at]
        slot = 0
        while slot < num_found and found[slot] != of:
            slot += 1
        if slot == num_found:
            found[slot] = of
            for j in range(sums.shape[1]):
                sums[slot, j] = 0
            num_found += 1
        sums[slot, 0] += w
        for j in range(min(weight.shape[2], sums.shape[1] - 1)):
            sums[slot, 1 + j] += w * np.float32(weight[view, at, j])
    return num_found


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _places_in(levels, relief, place, x, y, z, slant, out):  # type: ignore[no-untyped-def]
    """Find the places that stand for a footprint, and how high the relief is that is seen there.

    Args:
        levels: of the BTF. relief, place: as of `_send`. x, y, z: the direction to the eye. slant: s of it.
        out: u, v and height of each, written. (≥ places, 3)
    Returns:
        How many; the width of the footprint.
    """
    num, apart, width = along_footprint(place[2], z, np.float32(max(levels[0, 1], levels[0, 2])))
    across: Any = np.float32(1) / max(np.float32(math.sqrt(x * x + y * y)), _LEAST_COSINE)
    for k in range(num):
        away = apart * across * (np.float32(k) - np.float32(0.5) * np.float32(num - 1))
        out[k, 0], out[k, 1] = place[0] + away * x, place[1] - away * y
        out[k, 2] = height_seen(relief[0], relief[1], relief[2], out[k, 0], out[k, 1], slant)
    return num, width


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _send(rings, tables, texels, relief, arriving, axes, wo, places, out):  # type: ignore[no-untyped-def]
    """Sum what n points send.

    Args:
        relief: heights, the lowest and the highest of them, slants of the sides.
        arriving: (n, 3, L). wo: in shading frames. (n, 3). places: u and v in repeats, side of the footprint. (n, 3)
        out: written. (n, 3)
    """
    levels, cluster, weight = texels
    sides = relief[3]
    index, of_view = np.empty(4, np.int32), np.empty(4, np.float32)
    texel, share = np.empty(8, np.int32), np.empty(8, np.float32)
    most = 8 * _MOST_PLACES
    found, sums = np.empty(most, np.int32), np.empty((most, tables.shape[2]), np.float32)
    of_places = np.empty((_MOST_PLACES, 3), np.float32)
    for p in range(arriving.shape[0]):
        out[p, :] = 0
        if wo[p, 2] <= 0:
            continue
        vx, vy = into_texture(wo[p, 0], wo[p, 1], axes[p])
        taps(rings, vx, vy, wo[p, 2], index, of_view)
        slant = slant_of(rings, vx, vy, wo[p, 2])
        num_places, width = _places_in(levels, relief, places[p], vx, vy, wo[p, 2], slant, of_places)
        part = np.float32(1) / np.float32(num_places)
        for tap in range(4):
            if of_view[tap] <= 0:
                continue
            side, num_found = sides[index[tap]], 0
            for k in range(num_places):
                u, v, h = of_places[k, 0], of_places[k, 1], of_places[k, 2]
                across, up = h * (slant[0] - side[0]), h * (slant[1] - side[1])
                num = texels_about(levels, u + across, v - up, width, texel, share)
                num_found = _add_weights(cluster, weight, index[tap], texel, share, num, part, num_found, found, sums)
            for slot in range(num_found):
                of_cluster = tables[index[tap], found[slot]]
                for j in range(tables.shape[2]):
                    factor = of_view[tap] * sums[slot, j]
                    for channel in range(3):
                        total = np.float32(0)
                        for light in range(tables.shape[4]):
                            total += of_cluster[j, channel, light] * arriving[p, channel, light]
                        out[p, channel] += factor * total
        for channel in range(3):
            out[p, channel] = max(out[p, channel], np.float32(0))


def _places(texels: Texels, uv: F32) -> F32:
    """Where points are on the texture. (n, 3), as `_send` wants them"""
    cosine, sine, u, up = math.cos(texels.rotation), math.sin(texels.rotation), uv[:, 0], -uv[:, 1]
    # up in the texture is down in its coordinates
    places = texels.scale * np.stack([cosine * u + sine * up, sine * u - cosine * up, uv[:, 2]], axis=1)
    return places.astype(np.float32)


def texel_rows(texels: Texels, lights: TriangleLights | None, receivers: Receivers, start: int, stop: int) -> F32:
    """Find what points send, texel by texel.

    Args:
        texels: how they are covered. lights: of the environment, None for rays alone.
        receivers: all points; `uv` says where they are.
        start, stop: those that are asked about.
    Returns:
        Radiance. (stop - start, 3) float32
    """
    return sent_rows(texels, texels.tables, arrived_rows(texels, lights, receivers, start, stop), receivers, start)


def sent_rows(texels: Texels, tables: F32, arrived: F32, receivers: Receivers, start: int) -> F32:
    """Find what points send of light that has been shared out.

    Args:
        texels: how they are covered. tables: of the BTF, or those that `turned_tables` made of them.
        arrived: at the points that are asked about, see `arrived_rows`. (n, 3, L)
        receivers: all points; `uv` says where they are. start: the first that is asked about.
    Returns:
        Radiance. (n, 3) float32
    """
    assert receivers.uv is not None
    rows, found = slice(start, start + len(arrived)), texels.btf
    uv, axes = receivers.uv[rows], texture_axes(texels.rotation, receivers.uv[rows])
    n, t, wo = (np.ascontiguousarray(a[rows], np.float32) for a in (receivers.normal, receivers.tangent, receivers.wo))
    local = np.stack([(t * wo).sum(axis=1), (np.cross(n, t) * wo).sum(axis=1), (n * wo).sum(axis=1)], axis=1)
    out = np.empty((len(arrived), 3), np.float32)
    of_texels = found.levels, found.cluster, found.weight
    relief = found.height, found.height.min(), found.height.max(), slants(found.rings)
    args = found.rings, tables, of_texels, relief, arrived, axes, np.ascontiguousarray(local), _places(texels, uv), out
    _send(*args)
    return out


def texel_numpy(texels: Texels, directions: F64, irradiance: F64, wo: F64, place: F64, footprint: float = 0.0) -> F64:
    """Do as `texel_rows` for one point under given lights, in plain NumPy: its oracle.

    Args:
        texels: how it is covered. directions: to lights, in the texture's frame, unit. (m, 3)
        irradiance: of each light, across its direction. (m, 3)
        wo: to the eye, in the texture's frame. (3,)
        place: column and row, in texels of the finest level, from the middle of the first.
        footprint: side of the square of its area, in texels; no wider than two of them, seen from a slant.
    Returns:
        (3,) float64
    """
    length = footprint / np.sqrt(wo[2])
    num = 1 if length**2 <= 3 else int(np.clip(np.ceil(length / _APART), 2, _MOST_PLACES))
    apart = np.sqrt((length**2 - 3) / (num**2 - 1)) if num > 1 else 0.0
    away = apart * (np.arange(num) - (num - 1) / 2)
    places = place + away[:, None] * wo[:2] / np.hypot(wo[0], wo[1]) * [1, -1]
    sent = sent_numpy(texels.btf, seen_numpy(texels.btf, places, wo), directions)
    return np.asarray((sent * irradiance).sum(axis=0).clip(0))
