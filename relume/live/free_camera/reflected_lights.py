"""Bright lights of the environment in surfaces that lobe rays meet, while a camera moves.

One ray of a pixel hardly ever mirrors the sun after a second reflection. So the sun is evaluated there by the density
of the surface's lobe, stretched to the median angle of lobe, light and beam together:

    p(θh) = p₀(θh / s) / s² ,   s² = 1 + (ρ² / 8 + b²) / m² .

m is the median of the lobe's half angle, ρ the radius of the light, b the median by which the half vectors of the beam
spread, which stands for a pixel. (Kaplanyan et al. 2016, "Filtering distributions of normals for shading
antialiasing", stretch lobes alike.)
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT
from relume.live.free_camera.lobe_lights import disk_radius
from relume.math.fast_math import acos_clamped

_ZERO, _HALF, _ONE, _TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
_PI = np.float32(math.pi)
_EIGHTH = np.float32(1 / 8)
_SIDE_MEDIAN = np.float32(1 / math.sqrt(2 * math.pi))  # half of a square lies this near to its middle, by its side
_TINY = np.float32(1e-12)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def tabulated_density(quantile, row, angle):  # type: ignore[no-untyped-def]
    """Density of a distribution of directions at an angle from its axis, per steradian.

    Args:
        quantile: `LobeSurfaces.quantile`. row: in it. angle: radians.
    """
    low, high = 0, quantile.shape[1] - 1
    if angle >= quantile[row, high]:
        return _ZERO
    while high - low > 1:
        middle = (low + high) // 2
        if quantile[row, middle] <= angle:
            low = middle
        else:
            high = middle
    inner, outer = (
        np.float32(math.sin(_HALF * quantile[row, low])),
        np.float32(math.sin(_HALF * quantile[row, high])),
    )
    area = np.float32(4) * _PI * max(outer * outer - inner * inner, _TINY * _TINY)
    return _ONE / (np.float32(quantile.shape[1] - 1) * area)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def add_reflected_lights(lights, gain, surfaces, paths, entry, out):  # type: ignore[no-untyped-def]
    """Add the bright lights that the lobe at a reflection shows.

    Args:
        lights: of `PrefilteredEnvironment`. gain: of the environment. (3,) surfaces: `LobeSurfaces`.
        paths, entry: the reflection, an entry of `LobePaths`. out: added to. (3,)
    """
    lobe, n, o = paths.lobe[entry], paths.normal[entry], paths.direction[entry]
    median = max(surfaces.quantile[lobe, (surfaces.quantile.shape[1] - 1) // 2], _TINY)
    to_half = _ONE if surfaces.is_half_angle[lobe] else _TWO
    spread = _HALF * to_half * _SIDE_MEDIAN * paths.spread[entry]
    for k in range(lights.shape[0]):
        x, y, z = lights[k, 0], lights[k, 1], lights[k, 2]
        along = n[0] * x + n[1] * y + n[2] * z
        if along <= 0:
            continue
        hx, hy, hz = x + o[0], y + o[1], z + o[2]
        length = np.float32(math.sqrt(hx * hx + hy * hy + hz * hz)) + np.float32(1e-6)
        angle, per_direction = acos_clamped((n[0] * hx + n[1] * hy + n[2] * hz) / length), _HALF / length
        if not surfaces.is_half_angle[lobe]:
            facing = n[0] * o[0] + n[1] * o[1] + n[2] * o[2]
            angle, per_direction = acos_clamped(_TWO * facing * along - (x * o[0] + y * o[1] + z * o[2])), _ONE
        radius = to_half * disk_radius(lights[k, 6])
        stretch = np.float32(math.sqrt(_ONE + (_EIGHTH * radius * radius + spread * spread) / (median * median)))
        density = tabulated_density(surfaces.quantile, lobe, angle / stretch) * per_direction / (stretch * stretch)
        for channel in range(3):
            out[channel] += density * gain[channel] * paths.throughput[entry, channel] * lights[k, 3 + channel]
