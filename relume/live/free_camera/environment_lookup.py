"""Environment lookups: sharp for the background, and prefiltered for lobes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.math.fast_math import acos_clamped, azimuth_fraction

F32 = NDArray[np.float32]

_MIN_BLUR_DEG = 2.0  # σ of the first blurred level, degrees
_LEVELS_PER_OCTAVE = 2  # levels until σ doubles; between levels, lookups interpolate
_NUM_BLURRED = 9


class EnvironmentLookup(NamedTuple):
    """An environment and its blurred levels, concatenated.

    Attributes:
        texels: radiance of all levels.
        levels: first texel, height, width of each, sharpest first.
    """

    texels: Shaped[F32, "texels 3"]
    levels: Shaped[NDArray[np.int64], "levels 3"]


def build_environment_lookup(
    sharp: Shaped[F32, "height width 3"], blurred_map: Callable[[float], F32]
) -> EnvironmentLookup:
    """Blur an environment in steps.

    Args:
        sharp: its radiance.
        blurred_map: returns it blurred by an angle in degrees. (height, width, 3) float32
    """
    maps = [sharp, *(blurred_map(_MIN_BLUR_DEG * 2 ** (k / _LEVELS_PER_OCTAVE)) for k in range(_NUM_BLURRED))]
    ends = np.cumsum([0, *(radiance.shape[0] * radiance.shape[1] for radiance in maps)])
    levels = [(end, *radiance.shape[:2]) for end, radiance in zip(ends, maps, strict=False)]
    return EnvironmentLookup(np.concatenate([radiance.reshape(-1, 3) for radiance in maps]), np.array(levels, np.int64))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _direction_to_uv(rotation, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Return u and v of a direction, both in [0, 1]."""
    u = azimuth_fraction(dx, dz) + rotation
    whole = np.int64(u)
    from_pole = np.float32(1 / math.pi) * acos_clamped(abs(dy))
    v = from_pole if dy > 0 else np.float32(1) - from_pole
    return u - np.float32(whole - 1 if u < whole else whole), v


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _sample_level(environment, level, u, v):  # type: ignore[no-untyped-def]
    """Sample one level, bilinear and periodic in u. Returns three numbers."""
    first, height, width = environment.levels[level, 0], environment.levels[level, 1], environment.levels[level, 2]
    x = u * np.float32(width) - np.float32(0.5)
    y = min(max(v * np.float32(height) - np.float32(0.5), np.float32(0)), np.float32(height - 1))
    # floor without a call: x is at least −½
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def blur_level(sigma):  # type: ignore[no-untyped-def]
    """Return the level of a blur of σ radians, without an upper limit."""
    step = np.float32(_LEVELS_PER_OCTAVE) * math.log2(
        max(sigma * np.float32(180 / math.pi / _MIN_BLUR_DEG), np.float32(1e-3))
    )
    return max(step + np.float32(1), np.float32(0))


# Inlined: calls would count references of arrays, for which threads wait for each other.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def add_environment(environment, rotation, direction, level, gain, out):  # type: ignore[no-untyped-def]
    """Add the prefiltered radiance in a direction.

    Args:
        environment: its levels. rotation: rotation of the map, in turns, plus one half.
        direction: unit, a tuple. level: level of the blur, from `blur_level`. gain: a factor.
        out: added to. (3,)
    """
    level_coordinate = min(level, np.float32(environment.levels.shape[0] - 1))
    lower = np.int64(level_coordinate)
    fraction = level_coordinate - np.float32(lower)
    u, v = _direction_to_uv(rotation, direction[0], direction[1], direction[2])
    upper = min(lower + 1, environment.levels.shape[0] - 1)
    sharp, blurred = _sample_level(environment, lower, u, v), _sample_level(environment, upper, u, v)
    for channel in range(3):
        out[channel] += gain * (sharp[channel] + fraction * (blurred[channel] - sharp[channel]))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _sample(environment, rotation, gain, face, directions, start, stop, out):  # type: ignore[no-untyped-def]
    """Write the environment to pixels [start, stop) without a surface."""
    for p in range(start, stop):
        if face[p] >= 0:
            continue
        u, v = _direction_to_uv(rotation, directions[p, 0], directions[p, 1], directions[p, 2])
        radiance = _sample_level(environment, 0, u, v)
        for channel in range(3):
            out[p, channel] = gain[channel] * radiance[channel]


def rotation_of(rotation: float) -> np.float32:
    """Return the rotation of a map for kernels, from degrees."""
    return np.float32(0.5 + rotation / 360)


def sample(
    radiance: Shaped[F32, "height width 3"],
    rotation: float,
    gain: Shaped[F32, " 3"],
    face: Shaped[NDArray[np.int32], " n"],
    directions: Shaped[F32, "n 3"],
    out: Shaped[F32, "n 3"],
) -> None:
    """Write the environment to pixels without a surface.

    Args:
        radiance: radiance of the environment, equirectangular.
        rotation: about +Y, degrees, counterclockwise from above. gain: per channel.
        face: face of each pixel, −1 for none. directions: unit, of the rays.
        out: radiance, float32, written there.
    """
    environment = EnvironmentLookup(
        np.ascontiguousarray(radiance).reshape(-1, 3), np.array([[0, *radiance.shape[:2]]], np.int64)
    )
    args = (environment, rotation_of(rotation), gain, face, directions)
    parallel_for_chunks(lambda start, stop: _sample(*args, start, stop, out), len(face))
