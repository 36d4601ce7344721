"""The environment as an eye sees it past all surfaces, and blurred, as lobes do."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.arcs import acos_clamped, azimuth_turns
from relume.parallel import for_shares
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

_NARROWEST = 2.0  # σ of the first level that is blurred, degrees
_STEPS = 2  # levels until σ is twice as large: what is between two is a sum of both, and no blur
_NUM_BLURRED = 9


class Sky(NamedTuple):
    """An environment and its blurred levels, one after another.

    Attributes:
        texels: (texels, 3) float32
        levels: first texel, height, width of each, sharpest first. (levels, 3) int64
    """

    texels: F32
    levels: NDArray[np.int64]


def sky_of(sharp: F32, map_of: Callable[[float], F32]) -> Sky:
    """Blur an environment by steps.

    Args:
        sharp: its radiance. (height, width, 3) float32
        map_of: what of it is blurred, by degrees. (height, width, 3) float32
    """
    maps = [sharp, *(map_of(_NARROWEST * 2 ** (k / _STEPS)) for k in range(_NUM_BLURRED))]
    ends = np.cumsum([0, *(radiance.shape[0] * radiance.shape[1] for radiance in maps)])
    levels = [(end, *radiance.shape[:2]) for end, radiance in zip(ends, maps, strict=False)]
    return Sky(np.concatenate([radiance.reshape(-1, 3) for radiance in maps]), np.array(levels, np.int64))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _place(turn, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Find u and v of a direction, both in [0, 1]."""
    u = azimuth_turns(dx, dz) + turn
    whole = np.int64(u)
    from_pole = np.float32(1 / math.pi) * acos_clamped(abs(dy))
    v = from_pole if dy > 0 else np.float32(1) - from_pole
    return u - np.float32(whole - 1 if u < whole else whole), v


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _level_at(sky, level, u, v):  # type: ignore[no-untyped-def]
    """Look up one level in a place; bilinear, round about in u. Returns three numbers."""
    first, height, width = sky.levels[level, 0], sky.levels[level, 1], sky.levels[level, 2]
    x = u * np.float32(width) - np.float32(0.5)
    y: Any = min(max(v * np.float32(height) - np.float32(0.5), np.float32(0)), np.float32(height - 1))
    # rounded down without a call: x is −½ at least
    column, row = np.int64(x + np.float32(1)) - 1, np.int64(y)
    fx, fy = x - np.float32(column), y - np.float32(row)
    beside, below = (column + 1 if column + 1 < width else column + 1 - width), min(row + 1, height - 1)
    column = column + width if column < 0 else column
    upper, lower = first + row * width, first + below * width
    a, b, c, d = upper + column, upper + beside, lower + column, lower + beside
    wb, wd = fx * (np.float32(1) - fy), fx * fy
    wa, wc = np.float32(1) - fy - wb, fy - wd
    t = sky.texels
    return (
        wa * t[a, 0] + wb * t[b, 0] + wc * t[c, 0] + wd * t[d, 0],
        wa * t[a, 1] + wb * t[b, 1] + wc * t[c, 1] + wd * t[d, 1],
        wa * t[a, 2] + wb * t[b, 2] + wc * t[c, 2] + wd * t[d, 2],
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def level_of(sigma):  # type: ignore[no-untyped-def]
    """Find the level of a blur of σ radians, as if there were any number of them."""
    step = np.float32(_STEPS) * math.log2(max(sigma * np.float32(180 / math.pi / _NARROWEST), np.float32(1e-3)))
    return max(step + np.float32(1), np.float32(0))


# Inlined, as what it calls: calls would count the references of arrays, for which threads wait for each other.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def add_sky_about(sky, turn, direction, level, gain, out):  # type: ignore[no-untyped-def]
    """Add the light about a direction.

    Args:
        sky: its levels. turn: of the map, as a share of a whole turn, and a half.
        direction: unit, a tuple. level: of the blur, from `level_of`. gain: that it is multiplied by.
        out: added to. (3,)
    """
    place: Any = min(level, np.float32(sky.levels.shape[0] - 1))
    lower = np.int64(place)
    share = place - np.float32(lower)
    u, v = _place(turn, direction[0], direction[1], direction[2])
    beside: Any = min(lower + 1, sky.levels.shape[0] - 1)
    sharp, blurred = _level_at(sky, lower, u, v), _level_at(sky, beside, u, v)
    for channel in range(3):
        out[channel] += gain * (sharp[channel] + share * (blurred[channel] - sharp[channel]))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _fill(sky, turn, gain, face, directions, start, stop, out):  # type: ignore[no-untyped-def]
    """Fill pixels [start, stop) that see nothing."""
    for p in range(start, stop):
        if face[p] >= 0:
            continue
        u, v = _place(turn, directions[p, 0], directions[p, 1], directions[p, 2])
        found = _level_at(sky, 0, u, v)
        for channel in range(3):
            out[p, channel] = gain[channel] * found[channel]


def turn_of(rotation: float) -> np.float32:
    """The turn of a map, as kernels take it, from its rotation in degrees."""
    return np.float32(0.5 + rotation / 360)


def fill_sky(radiance: F32, rotation: float, gain: F32, face: NDArray[np.int32], directions: F32, out: F32) -> None:
    """Fill the pixels that see no surface.

    Args:
        radiance: of the environment, equirectangular. (height, width, 3) float32
        rotation: of it about +Y, degrees, counter-clockwise seen from above. gain: of each channel. (3,) float32
        face: that each pixel sees, −1 for none. (n,) int32. directions: of their rays, unit. (n, 3) float32
        out: written there. (n, 3) float32
    """
    sky = Sky(np.ascontiguousarray(radiance).reshape(-1, 3), np.array([[0, *radiance.shape[:2]]], np.int64))
    args = (sky, turn_of(rotation), gain, face, directions)
    for_shares(lambda start, stop: _fill(*args, start, stop, out), len(face))
