"""The environment as an eye sees it past all surfaces, and blurred, as lobes do."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.core.thread_pools import parallel_for_chunks
from relume.math.fast_math import acos_clamped, azimuth_fraction

F32 = NDArray[np.float32]

_MIN_BLUR_DEG = 2.0  # σ of the first level that is blurred, degrees
_LEVELS_PER_OCTAVE = 2  # levels until σ is twice as large: what is between two is a sum of both, and no blur
_NUM_BLURRED = 9


class EnvironmentLookup(NamedTuple):
    """An environment and its blurred levels, one after another.

    Attributes:
        texels: (texels, 3) float32
        levels: first texel, height, width of each, sharpest first. (levels, 3) int64
    """

    texels: F32
    levels: NDArray[np.int64]


def build_environment_lookup(sharp: F32, blurred_map: Callable[[float], F32]) -> EnvironmentLookup:
    """Blur an environment by steps.

    Args:
        sharp: its radiance. (height, width, 3) float32
        blurred_map: what of it is blurred, by degrees. (height, width, 3) float32
    """
    maps = [sharp, *(blurred_map(_MIN_BLUR_DEG * 2 ** (k / _LEVELS_PER_OCTAVE)) for k in range(_NUM_BLURRED))]
    ends = np.cumsum([0, *(radiance.shape[0] * radiance.shape[1] for radiance in maps)])
    levels = [(end, *radiance.shape[:2]) for end, radiance in zip(ends, maps, strict=False)]
    return EnvironmentLookup(np.concatenate([radiance.reshape(-1, 3) for radiance in maps]), np.array(levels, np.int64))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _direction_to_uv(rotation, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Find u and v of a direction, both in [0, 1]."""
    u = azimuth_fraction(dx, dz) + rotation
    whole = np.int64(u)
    from_pole = np.float32(1 / math.pi) * acos_clamped(abs(dy))
    v = from_pole if dy > 0 else np.float32(1) - from_pole
    return u - np.float32(whole - 1 if u < whole else whole), v


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _sample_level(environment, level, u, v):  # type: ignore[no-untyped-def]
    """Look up one level in a place; bilinear, round about in u. Returns three numbers."""
    first, height, width = environment.levels[level, 0], environment.levels[level, 1], environment.levels[level, 2]
    x = u * np.float32(width) - np.float32(0.5)
    y: Any = min(max(v * np.float32(height) - np.float32(0.5), np.float32(0)), np.float32(height - 1))
    # rounded down without a call: x is −½ at least
    column, row = np.int64(x + np.float32(1)) - 1, np.int64(y)
    fx, fy = x - np.float32(column), y - np.float32(row)
    next_column, next_row = (column + 1 if column + 1 < width else column + 1 - width), min(row + 1, height - 1)
    column = column + width if column < 0 else column
    upper, lower = first + row * width, first + next_row * width
    a, b, c, d = upper + column, upper + next_column, lower + column, lower + next_column
    wb, wd = fx * (np.float32(1) - fy), fx * fy
    wa, wc = np.float32(1) - fy - wb, fy - wd
    t = environment.texels
    return (
        wa * t[a, 0] + wb * t[b, 0] + wc * t[c, 0] + wd * t[d, 0],
        wa * t[a, 1] + wb * t[b, 1] + wc * t[c, 1] + wd * t[d, 1],
        wa * t[a, 2] + wb * t[b, 2] + wc * t[c, 2] + wd * t[d, 2],
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def blur_level(sigma):  # type: ignore[no-untyped-def]
    """Find the level of a blur of σ radians, as if there were any number of them."""
    step = np.float32(_LEVELS_PER_OCTAVE) * math.log2(
        max(sigma * np.float32(180 / math.pi / _MIN_BLUR_DEG), np.float32(1e-3))
    )
    return max(step + np.float32(1), np.float32(0))


# Inlined, as what it calls: calls would count the references of arrays, for which threads wait for each other.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def add_environment(environment, rotation, direction, level, gain, out):  # type: ignore[no-untyped-def]
    """Add the light about a direction.

    Args:
        environment: its levels. rotation: of the map, as a share of a whole turn, and a half.
        direction: unit, a tuple. level: of the blur, from `blur_level`. gain: that it is multiplied by.
        out: added to. (3,)
    """
    level_coordinate: Any = min(level, np.float32(environment.levels.shape[0] - 1))
    lower = np.int64(level_coordinate)
    fraction = level_coordinate - np.float32(lower)
    u, v = _direction_to_uv(rotation, direction[0], direction[1], direction[2])
    upper: Any = min(lower + 1, environment.levels.shape[0] - 1)
    sharp, blurred = _sample_level(environment, lower, u, v), _sample_level(environment, upper, u, v)
    for channel in range(3):
        out[channel] += gain * (sharp[channel] + fraction * (blurred[channel] - sharp[channel]))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _sample(environment, rotation, gain, face, directions, start, stop, out):  # type: ignore[no-untyped-def]
    """Fill pixels [start, stop) that see nothing."""
    for p in range(start, stop):
        if face[p] >= 0:
            continue
        u, v = _direction_to_uv(rotation, directions[p, 0], directions[p, 1], directions[p, 2])
        radiance = _sample_level(environment, 0, u, v)
        for channel in range(3):
            out[p, channel] = gain[channel] * radiance[channel]


def rotation_of(rotation: float) -> np.float32:
    """The turn of a map, as kernels take it, from its rotation in degrees."""
    return np.float32(0.5 + rotation / 360)


def sample(radiance: F32, rotation: float, gain: F32, face: NDArray[np.int32], directions: F32, out: F32) -> None:
    """Fill the pixels that see no surface.

    Args:
        radiance: of the environment, equirectangular. (height, width, 3) float32
        rotation: of it about +Y, degrees, counter-clockwise seen from above. gain: of each channel. (3,) float32
        face: that each pixel sees, −1 for none. (n,) int32. directions: of their rays, unit. (n, 3) float32
        out: written there. (n, 3) float32
    """
    environment = EnvironmentLookup(
        np.ascontiguousarray(radiance).reshape(-1, 3), np.array([[0, *radiance.shape[:2]]], np.int64)
    )
    args = (environment, rotation_of(rotation), gain, face, directions)
    parallel_for_chunks(lambda start, stop: _sample(*args, start, stop, out), len(face))
