"""Directions and weights of gather rays (final gathering), recomputed wherever they are needed, never stored.

A point has `num_cosine` rays of density cos θi / π and `num_glossy` rays around its mirror direction, whose half
vectors have the density

    p(h) = 1 / (2π ln(1 + 1/ε) (1 − cos θh + ε)),   p(ωi) = p(h) / (4 cos θd):

equally many in every octave of a highlight's size, because the highlight is unknown when rays are traced. A ray has the
weight cos θi / (num_cosine · cos θi / π + num_glossy · p(ωi)), the balance heuristic of both.

Both sets are Fibonacci lattices on the unit square (u, v), which map to spirals on the disk. Over all shifts within one
lattice cell, samples are uniform: points share one pattern, each shifted within a cell by its seed (Cranley-Patterson).
So the same ray of neighbors has nearly the same direction, and may be traced together with theirs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import PlanError

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_RAYS = 4096
_PI = np.float32(math.pi)
_EPSILON = np.float32(1e-3)  # the density of rays rises up to highlights of about 3°
_GROWTH = np.float32(1 + 1e3)  # 1 + 1/ε
_LN = np.float32(math.log(1 + 1e3))
_GOLDEN = (1 + math.sqrt(5)) / 2
# the last two steps of Roberts' R4 sequence, as fractions of 2^32: independent of the lattices
_PLASTIC = 1.1673039782614187  # x⁵ = x + 1
STEP_U, STEP_V = (np.uint32(round(2**32 / _PLASTIC**k)) for k in (3, 4))
_PER_UNIT = np.float32(1 / (1 << 24))


class RayPattern(NamedTuple):
    """Gather rays of every point, before their shift.

    Attributes:
        uv: points on the unit square; first the cosine rays, then the glossy rays.
        rays: u, (1 + 1/ε)^u, cos 2πv and sin 2πv.
        num_cosine: number of cosine-distributed rays.
        sides: two edge vectors of a lattice cell for each of the two sets.
        seed: seed of the shifts.
    """

    uv: Shaped[F32, "N 2"]
    rays: Shaped[F32, "N 4"]
    num_cosine: int
    sides: Shaped[F32, "2 2 2"]
    seed: int

    @property
    def num_rays(self) -> int:
        """Number of rays N."""
        return len(self.rays)


def make_pattern(num_cosine: int, num_glossy: int, seed: int) -> RayPattern:
    """Distribute two sets of rays uniformly.

    Args:
        num_cosine: cosine-distributed rays, at least 1. num_glossy: rays around the mirror direction, or 0.
        seed: seed of the shifts; only the lowest 31 bits count.
    Raises:
        PlanError: there are no rays, or more than `MAX_RAYS`.
    """
    if not (num_cosine >= 1 and num_glossy >= 0 and num_cosine + num_glossy <= MAX_RAYS):
        raise PlanError(f"{num_cosine} + {num_glossy} gather rays were requested; give 1 to {MAX_RAYS} in total")
    uv = np.concatenate([fibonacci_lattice(num_cosine), fibonacci_lattice(num_glossy)])
    u, v = uv.T
    rays = np.stack([u, (1 + 1e3) ** u, np.cos(2 * np.pi * v), np.sin(2 * np.pi * v)], axis=1)
    sides = np.stack([shortest_lattice_vectors(num_cosine), shortest_lattice_vectors(max(1, num_glossy))])
    return RayPattern(
        uv.astype(np.float32), rays.astype(np.float32), num_cosine, sides.astype(np.float32), seed & 0x7FFFFFFF
    )


def _step(count: int) -> int:
    """Choose the step of a lattice of `count` points: for a Fibonacci number, its predecessor."""
    step = max(1, round(count / _GOLDEN))
    while math.gcd(step, count) > 1:
        step += 1
    return step


def fibonacci_lattice(count: int) -> F64:
    """Lattice of points on the unit square. (count, 2)"""
    i = np.arange(count)
    return np.stack([(i + 0.5) / max(1, count), i * _step(count) % max(1, count) / max(1, count)], axis=1)


def shortest_lattice_vectors(count: int) -> F64:
    """Two shortest vectors between lattice points, by Lagrange reduction. (2, 2)"""
    shorter, longer = np.array([1.0, _step(count)]) / count, np.array([0.0, 1.0])
    while True:
        if shorter @ shorter > longer @ longer:
            shorter, longer = longer, shorter
        multiple = round(float(shorter @ longer / (shorter @ shorter)))
        if multiple == 0:
            return np.stack([shorter, longer])
        longer = longer - multiple * shorter


# The following functions are inlined: calls would count references to the pattern's arrays, which threads share.
@nb.njit(nogil=True, cache=True, inline="always")
def cranley_patterson_offset(pattern, seed):  # type: ignore[no-untyped-def]
    """Offset of the unit square for a point, from its seed. Two float32 in [0, 1).

    Offsets of successive seeds are a low-discrepancy sequence.
    """
    start = np.uint32(pattern.seed) * np.uint32(0x9E3779B9)
    u = np.uint32(start + np.uint32(seed) * STEP_U)
    v = np.uint32(start + np.uint32(seed) * STEP_V)
    return np.float32(u >> np.uint32(8)) * _PER_UNIT, np.float32(v >> np.uint32(8)) * _PER_UNIT


@nb.njit(nogil=True, cache=True, inline="always")
def _along_lattice(sides, s, t):  # type: ignore[no-untyped-def]
    """Vector s, t along the two edges of a lattice cell, as u, (1 + 1/ε)^u, cos 2πv and sin 2πv."""
    u = s * sides[0, 0] + t * sides[1, 0]
    azimuth = np.float32(2) * _PI * (s * sides[0, 1] + t * sides[1, 1])
    return np.float32(u), np.float32(math.exp(_LN * u)), np.float32(math.cos(azimuth)), np.float32(math.sin(azimuth))


@nb.njit(nogil=True, cache=True, inline="always")
def lattice_offsets(pattern, seed):  # type: ignore[no-untyped-def]
    """Offset of a point within a cell of each set's lattice, as u, (1 + 1/ε)^u, cos 2πv and sin 2πv."""
    s, t = cranley_patterson_offset(pattern, seed)
    s, t = s - np.float32(0.5), t - np.float32(0.5)
    return _along_lattice(pattern.sides[0], s, t), _along_lattice(pattern.sides[1], s, t)


@nb.njit(nogil=True, cache=True, inline="always")
def glossy_pdf(cos_theta_h, cos_theta_d):  # type: ignore[no-untyped-def]
    """Density p(ωi) of the glossy rays, 1/sr."""
    one_minus_cosine = np.float32(1) - cos_theta_h + _EPSILON
    return np.float32(1) / (np.float32(8) * _PI * _LN * one_minus_cosine * max(cos_theta_d, np.float32(1e-6)))


@nb.njit(nogil=True, cache=True, inline="always")
def cosine_ray(ray, offset):  # type: ignore[no-untyped-def]
    """Direction of a cosine ray, in the frame x = tangent, y = n × t, z = n.

    ray: a row of `RayPattern.rays`. offset: offset of the set, from `lattice_offsets`.
    """
    u = ray[0] + offset[0]
    u -= np.float32(u >= 1)
    u += np.float32(u < 0)
    radius = np.float32(math.sqrt(u))
    x, y = ray[2] * offset[2] - ray[3] * offset[3], ray[3] * offset[2] + ray[2] * offset[3]
    return radius * x, radius * y, np.float32(math.sqrt(np.float32(1) - u))


@nb.njit(nogil=True, cache=True, inline="always")
def glossy_ray(ray, offset, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Direction of a glossy ray in the same frame; rays below the horizon must not be traced.

    Args:
        ray: a row of `RayPattern.rays`. offset: offset of the set, from `lattice_offsets`.
        ox, oy, oz: local wo, toward the viewer.
    """
    u, growth = ray[0] + offset[0], ray[1] * offset[1]
    growth *= np.float32(1 / 1001) if u >= 1 else (_GROWTH if u < 0 else np.float32(1))
    one_minus_cosine = max(np.float32(0), min(_EPSILON * (growth - np.float32(1)), np.float32(1)))
    sine = np.float32(math.sqrt(one_minus_cosine * (np.float32(2) - one_minus_cosine)))
    x, y = ray[2] * offset[2] - ray[3] * offset[3], ray[3] * offset[2] + ray[2] * offset[3]
    hx, hy, hz = sine * x, sine * y, np.float32(1) - one_minus_cosine
    twice_cosine = np.float32(2) * (ox * hx + oy * hy + oz * hz)
    return twice_cosine * hx - ox, twice_cosine * hy - oy, twice_cosine * hz - oz


@nb.njit(nogil=True, cache=True, inline="always")
def local_ray(pattern, ray, offsets, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Direction of a ray of a point, in the point's local frame.

    Args:
        pattern: the rays of every point. ray: index of the ray.
        offsets: offsets of the point, from `lattice_offsets`. ox, oy, oz: local wo.
    """
    if ray < pattern.num_cosine:
        return cosine_ray(pattern.rays[ray], offsets[0])
    return glossy_ray(pattern.rays[ray], offsets[1], ox, oy, oz)


@nb.njit(nogil=True, cache=True, inline="always")
def ray_weight(pattern, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Weight of a ray: cos θi over the expected number of rays per solid angle, sr.

    Args:
        pattern: the rays of every point. ix, iy, iz: local wi of the ray. ox, oy, oz: local wo.
    """
    num_cosine = np.float32(pattern.num_cosine)
    num_glossy = np.float32(pattern.rays.shape[0] - pattern.num_cosine)
    if num_glossy == 0:
        return _PI / num_cosine
    hx, hy, hz = ix + ox, iy + oy, iz + oz
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    cos_theta_h = min(hz / max(length, np.float32(1e-6)), np.float32(1))
    pdf = glossy_pdf(cos_theta_h, np.float32(0.5) * length)
    return iz / (num_cosine * iz / _PI + num_glossy * pdf)
