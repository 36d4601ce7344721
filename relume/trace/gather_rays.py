"""Directions of gather rays, and what each of them stands for: made again wherever they are needed, never stored.

A point has `num_cosine` rays of density cos θi / π and `num_glossy` rays about its mirror direction, whose half vectors
have the density

    p(h) = 1 / (2π ln(1 + 1/ε) (1 − cos θh + ε)),   p(ωi) = p(h) / (4 cos θd):

as many in every octave of a highlight's size, since the highlight is not known when rays are traced. A ray weighs
cos θi / (num_cosine · cos θi / π + num_glossy · p(ωi)), the balance heuristic of both. All points share one pattern on
the unit square, shifted for each by an amount that its seed alone decides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.errors import PlanError

F32 = NDArray[np.float32]

MAX_RAYS = 4096
_PI = np.float32(math.pi)
_EPSILON = np.float32(1e-3)  # rays crowd towards the mirror direction up to highlights of about 3°
_LN = np.float32(math.log(1 + 1e3))
_GOLDEN = (1 + math.sqrt(5)) / 2
# the two last of Roberts' R4 sequence, as fractions of 2^32: steps that the spirals do not share
_PLASTIC = 1.1673039782614187  # x⁵ = x + 1
_STEP_U, _STEP_V = (np.uint32(round(2**32 / _PLASTIC**k)) for k in (3, 4))
_PER_UNIT = np.float32(1 / (1 << 24))


class Pattern(NamedTuple):
    """Rays of every point.

    Attributes:
        uv: on the unit square; the cosine rays' first, then the glossy ones'. (N, 2) float32
        num_cosine: how many are distributed by the cosine.
        seed: of the shifts.
    """

    uv: F32
    num_cosine: int
    seed: int


def make_pattern(num_cosine: int, num_glossy: int, seed: int) -> Pattern:
    """Two evenly spread sets, spirals on the disc (Vogel). Raises PlanError where there are none, or too many."""
    if not (num_cosine >= 1 and num_glossy >= 0 and num_cosine + num_glossy <= MAX_RAYS):
        raise PlanError(f"{num_cosine} + {num_glossy} gather rays were asked for; give 1 to {MAX_RAYS} in all")
    spirals = [
        np.stack([(np.arange(count) + 0.5) / count, np.arange(count) / _GOLDEN % 1], axis=1)
        for count in (num_cosine, num_glossy)
    ]
    return Pattern(np.concatenate(spirals).astype(np.float32), num_cosine, seed & 0x7FFFFFFF)


@nb.njit(nogil=True, cache=True)
def shift_of(pattern, point):  # type: ignore[no-untyped-def]
    """By how much the pattern of a point is moved. Two float32 in [0, 1).

    Points that follow each other are neighbours in the picture, and their shifts a low-discrepancy sequence: together
    they see more than each alone, and what noise is left is as fine as the pixels.
    """
    start = np.uint32(pattern.seed) * np.uint32(0x9E3779B9)
    u = np.uint32(start + np.uint32(point) * _STEP_U)
    v = np.uint32(start + np.uint32(point) * _STEP_V)
    return np.float32(u >> np.uint32(8)) * _PER_UNIT, np.float32(v >> np.uint32(8)) * _PER_UNIT


@nb.njit(nogil=True, cache=True)
def density_about_mirror(cos_theta_h, cos_theta_d):  # type: ignore[no-untyped-def]
    """p(ωi) of the glossy rays, 1/sr."""
    away = np.float32(1) - cos_theta_h + _EPSILON
    return np.float32(1) / (np.float32(8) * _PI * _LN * away * max(cos_theta_d, np.float32(1e-6)))


@nb.njit(nogil=True, cache=True)
def local_ray(pattern, ray, shift_u, shift_v, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Direction of a ray in the frame x = tangent, y = n × t, z = n; below the horizon where it is not to be traced.

    Args:
        ox, oy, oz: towards the viewer, in the frame; any where the pattern has no glossy rays.
    """
    u = pattern.uv[ray, 0] + shift_u
    v = pattern.uv[ray, 1] + shift_v
    u -= np.float32(math.floor(u))
    phi = np.float32(2) * _PI * v
    if ray < pattern.num_cosine:
        across = math.sqrt(u)
        return across * math.cos(phi), across * math.sin(phi), math.sqrt(np.float32(1) - u)
    away = min(_EPSILON * (math.exp(_LN * u) - np.float32(1)), np.float32(1))
    across = math.sqrt(away * (np.float32(2) - away))
    hx, hy, hz = across * math.cos(phi), across * math.sin(phi), np.float32(1) - away
    twice = np.float32(2) * (ox * hx + oy * hy + oz * hz)
    return twice * hx - ox, twice * hy - oy, twice * hz - oz


@nb.njit(nogil=True, cache=True)
def weight_of(pattern, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """cos θi over the expected number of rays per solid angle, sr."""
    num_cosine = np.float32(pattern.num_cosine)
    num_glossy = np.float32(pattern.uv.shape[0] - pattern.num_cosine)
    if num_glossy == 0:
        return _PI / num_cosine
    hx, hy, hz = ix + ox, iy + oy, iz + oz
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    cos_theta_h = min(hz / max(length, np.float32(1e-6)), np.float32(1))
    about_mirror = density_about_mirror(cos_theta_h, np.float32(0.5) * length)
    return iz / (num_cosine * iz / _PI + num_glossy * about_mirror)
