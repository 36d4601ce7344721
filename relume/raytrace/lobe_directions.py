"""Directions of lobe rays, drawn from the lobe of a term; recomputed wherever they are needed, never stored.

Rays are a Fibonacci lattice on the unit square (u, v): u is the quantile of the angle, v the azimuth; or, for an
anisotropic lobe, they are the quantiles of two angles, with a sign. Points share the
lattice, each shifted within a cell by its seed, as gather rays (`relume.raytrace.gather_rays`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.angles import TILT_X
from relume.brdf.lobe_sampling import LobeSampling
from relume.raytrace.gather_rays import cranley_patterson_offset, fibonacci_lattice, shortest_lattice_vectors

F32 = NDArray[np.float32]

_PI = np.float32(math.pi)
_ZERO, _HALF, _ONE, _TWO, _FOUR = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2), np.float32(4)
_MARGIN = np.float32(0.01)  # of a band, which rounding must not make a ray cross
_MIN_COSINE = np.float32(1e-4)
_TINY, _LARGEST_SQUARE = np.float32(1e-12), np.float32(1 - 1e-6)
# Roberts' R2 sequence, as fractions of 2^32
_STEP_U, _STEP_V = (np.uint32(round(2**32 / 1.32471795724474602596**k)) for k in (1, 2))
_PER_UNIT = np.float32(1 / (1 << 24))


class LobePattern(NamedTuple):
    """Lobe rays of every point, before their shift.

    Attributes:
        uv: points on the unit square.
        sides: two edge vectors of a lattice cell.
        seed: seed of the shifts.
        angles, axes, quantile, is_half_angle, is_narrow: as in `LobeSampling`; points of other levels have no rays.
        band_density: as in `LobeSampling`; of two angles, the two factors of the density per steradian.
        squared_sine: of each band, of the factor (1 − sin² γ₀ sin² γ₁)^1.5 between two tilts; zero for other angles.
        scale: bands per radian.
    """

    uv: Shaped[F32, "N 2"]
    sides: Shaped[F32, "2 2"]
    seed: int
    angles: Shaped[NDArray[np.int64], " angles"]
    axes: Shaped[F32, " 3"]
    quantile: Shaped[F32, "rows quantiles"]
    band_density: Shaped[F32, "rows J"]
    squared_sine: Shaped[F32, " J"]
    is_half_angle: bool
    is_narrow: Shaped[NDArray[np.bool_], " L"]
    scale: float

    @property
    def num_rays(self) -> int:
        """Number of rays N of a point."""
        return len(self.uv)


def make_lobe_pattern(sampling: LobeSampling, num_rays: int, seed: int) -> LobePattern:
    """Distribute rays over a lobe.

    Args:
        sampling: the lobe. num_rays: rays of a point. seed: only the lowest 31 bits count.
    """
    return LobePattern(
        fibonacci_lattice(num_rays).astype(np.float32),
        shortest_lattice_vectors(num_rays).astype(np.float32),
        seed & 0x7FFFFFFF,
        np.array(sampling.angles, np.int64),
        np.array(sampling.axes, np.float32),
        sampling.quantile,
        *_density_factors(sampling),
        sampling.is_half_angle,
        sampling.is_narrow,
        np.float32(sampling.band_density.shape[1] / (np.pi / 2)),  # type: ignore[arg-type]  # a kernel's float32
    )


def _density_factors(sampling: LobeSampling) -> tuple[Shaped[F32, "rows J"], Shaped[F32, " J"]]:
    """Return `band_density` and `squared_sine` of a pattern.

    Of two angles, dωh / (dγ₀ dγ₁) is cos³ θh / (cos² γ₀ cos² γ₁) for tilts, else sin γ₀ sin γ₁ / (l₀ l₁) with
    l = √(−2 ln cos γ). Both are products, the first times (1 − sin² γ₀ sin² γ₁)^−1.5.
    """
    num_bands = sampling.band_density.shape[1]
    angle = (np.arange(num_bands) + 0.5) * (np.pi / 2 / num_bands)
    sine, cosine = np.sin(angle), np.cos(angle)
    if len(sampling.angles) == 1:
        return sampling.band_density, np.zeros(num_bands, np.float32)
    if sampling.angles[0] == TILT_X:
        return np.asarray(sampling.band_density / cosine, np.float32), np.square(sine).astype(np.float32)
    extent = sine / np.sqrt(-2 * np.log(cosine))
    return np.asarray(sampling.band_density / extent, np.float32), np.zeros(num_bands, np.float32)


# The following functions are inlined: calls would count references to the pattern's arrays, which threads share.
@nb.njit(nogil=True, cache=True, inline="always")
def lobe_shift(pattern, seed):  # type: ignore[no-untyped-def]
    """Shift of a point's rays on the unit square, within a cell of the lattice. (2,) as a tuple"""
    s, t = cranley_patterson_offset(pattern, seed)
    s, t = s - _HALF, t - _HALF
    return (
        s * pattern.sides[0, 0] + t * pattern.sides[1, 0],
        s * pattern.sides[0, 1] + t * pattern.sides[1, 1],
    )


@nb.njit(nogil=True, cache=True, inline="always")
def lobe_vector(pattern, level, ray, shift):  # type: ignore[no-untyped-def]
    """Direction of a ray within its lobe, whatever the view direction: its half vector, or wi for wo on the normal.

    Args:
        pattern: a `LobePattern`. level: roughness level of the point. ray: index of the ray. shift: from `lobe_shift`.
    Returns:
        The vector, a tuple; band of the ray's angle, or of two angles as j₀ J + j₁.
    """
    u, v = _wrapped(pattern.uv[ray, 0] + shift[0]), _wrapped(pattern.uv[ray, 1] + shift[1])
    if pattern.angles.shape[0] == 1:
        angle, band = _angle_in_band(pattern, level, u)
        return _polar(angle, v), band
    along, first_band = _angle_in_band(pattern, 2 * level, abs(_TWO * u - _ONE))
    across, second_band = _angle_in_band(pattern, 2 * level + 1, abs(_TWO * v - _ONE))
    hx, hy, hz = _half_vector(pattern.angles[0], along, across)
    vector = hx if u >= _HALF else -hx, hy if v >= _HALF else -hy, hz
    return vector, first_band * pattern.band_density.shape[1] + second_band


@nb.njit(nogil=True, cache=True, inline="always")
def lobe_ray(pattern, vector, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Direction of a ray in the point's local frame, x = tangent, y = n × t, z = n.

    Args:
        pattern: a `LobePattern`. vector: from `lobe_vector`. ox, oy, oz: local wo, toward the viewer.
    Returns:
        Local wi, a tuple; False for rays that must not be traced, as they belong to no half vector that the viewer
        sees. They are not traced below the horizon either.
    """
    px, py, pz = mirrored_axis(pattern, ox, oy, oz) if pattern.angles.shape[0] == 1 else (ox, oy, oz)
    return _about_viewer(pattern.is_half_angle, vector, px, py, pz)


@nb.njit(nogil=True, cache=True, inline="always")
def _wrapped(u):  # type: ignore[no-untyped-def]
    """u in [−1, 2) modulo 1."""
    return u - _ONE if u >= _ONE else (u + _ONE if u < _ZERO else u)


@nb.njit(nogil=True, cache=True, inline="always")
def _angle_in_band(pattern, row, u):  # type: ignore[no-untyped-def]
    """Angle at a quantile, off the edges of its band, and the band. row: in `LobePattern.quantile`"""
    scaled = pattern.scale * angle_at_quantile(pattern.quantile, row, u)
    band = min(int(scaled), pattern.band_density.shape[1] - 1)
    within = min(max(scaled - np.float32(band), _ZERO if band == 0 else _MARGIN), _ONE - _MARGIN)
    return (np.float32(band) + within) / pattern.scale, band


@nb.njit(nogil=True, cache=True, inline="always")
def mirrored_axis(pattern, ox, oy, oz):  # type: ignore[no-untyped-def]
    """The direction, unit, that mirrors to the axis of a θr lobe; wo itself for all but Lafortune's.

    pattern: a `LobePattern`. ox, oy, oz: local wo.
    """
    x, y, z = pattern.axes[0] * ox, pattern.axes[1] * oy, pattern.axes[2] * oz
    scale = _ONE / max(np.float32(math.sqrt(x * x + y * y + z * z)), _MIN_COSINE)
    return x * scale, y * scale, z * scale


@nb.njit(nogil=True, cache=True, inline="always")
def _half_vector(angle, along, across):  # type: ignore[no-untyped-def]
    """Half vector, unit, at two angles. angle: the first one's `Angle`. along, across: radians, not negative"""
    if angle == TILT_X:
        x, y = np.float32(math.tan(along)), np.float32(math.tan(across))
        scale = _ONE / np.float32(math.sqrt(_ONE + x * x + y * y))
        return x * scale, y * scale, scale
    a, b = np.float32(math.sin(along)), np.float32(math.sin(across))
    x, y = _log_cosine(a), _log_cosine(b)
    sine = np.float32(math.sqrt(a * a + b * b - a * a * b * b))
    scale = sine / max(np.float32(math.sqrt(x * x + y * y)), _TINY)
    return x * scale, y * scale, np.float32(math.cos(along)) * np.float32(math.cos(across))


@nb.njit(nogil=True, cache=True, inline="always")
def _log_cosine(sine):  # type: ignore[no-untyped-def]
    """√(−2 ln cos γ), which is r cos φh for γα and r sin φh for γβ, r = √(−2 ln cos θh). sine: sin γ"""
    return np.float32(math.sqrt(-np.float32(math.log1p(-min(sine * sine, _LARGEST_SQUARE)))))


@nb.njit(nogil=True, cache=True, inline="always")
def angle_at_quantile(quantile, row, u):  # type: ignore[no-untyped-def]
    """Angle at the fraction u of a cumulative distribution, `LobeSampling.quantile` [row], radians."""
    num_cells = quantile.shape[1] - 1
    position = u * np.float32(num_cells)
    cell = min(int(position), num_cells - 1)
    low, high = quantile[row, cell], quantile[row, cell + 1]
    return low + (position - np.float32(cell)) * (high - low)


@nb.njit(nogil=True, cache=True, inline="always")
def _reflected(x, y, z, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Direction wi of a half vector, and whether the viewer sees it. x, y, z: h. ox, oy, oz: wo"""
    twice_cosine = _TWO * (ox * x + oy * y + oz * z)
    return (twice_cosine * x - ox, twice_cosine * y - oy, twice_cosine * z - oz), twice_cosine > _ZERO


@nb.njit(nogil=True, cache=True, inline="always")
def _polar(angle, v):  # type: ignore[no-untyped-def]
    """Unit vector at an angle to z, radians, and an azimuth, as a fraction of a turn."""
    azimuth, sine = _TWO * _PI * v, np.float32(math.sin(angle))
    return sine * np.float32(math.cos(azimuth)), sine * np.float32(math.sin(azimuth)), np.float32(math.cos(angle))


@nb.njit(nogil=True, cache=True, inline="always")
def _about_viewer(is_half_angle, vector, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Local wi of a half vector, or of a vector about the mirror direction. See `lobe_direction`."""
    x, y, z = vector
    if is_half_angle:
        return _reflected(x, y, z, ox, oy, oz)
    # about the mirror direction (−ox, −oy, oz): the frame that rotates n to it along the shortest arc
    inverse = _ONE / max(_ONE + oz, _MIN_COSINE)
    along = x * ox + y * oy
    return (
        x - ox * along * inverse - ox * z,
        y - oy * along * inverse - oy * z,
        along + oz * z,
    ), True


@nb.njit(nogil=True, cache=True, inline="always")
def lobe_direction(is_half_angle, angle, v, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Local wi at an angle of a lobe.

    Args:
        is_half_angle: whether the angle is θh, else θr. angle: radians. v: azimuth as a fraction of a turn.
        ox, oy, oz: local wo.
    Returns:
        wi, a tuple; False if it belongs to no half vector that the viewer sees.
    """
    return _about_viewer(is_half_angle, _polar(angle, v), ox, oy, oz)


@nb.njit(nogil=True, cache=True, inline="always")
def ray_jitter(ray, seed):  # type: ignore[no-untyped-def]
    """Two numbers in [0, 1) of a ray, spread evenly over the rays of a point. ray: its index. seed: of the point"""
    start = np.uint32(seed) * np.uint32(0x9E3779B9)
    u = np.uint32(start + np.uint32(ray) * _STEP_U)
    v = np.uint32((start ^ np.uint32(0x68E31DA4)) * np.uint32(0x85EBCA6B) + np.uint32(ray) * _STEP_V)
    return np.float32(u >> np.uint32(8)) * _PER_UNIT, np.float32(v >> np.uint32(8)) * _PER_UNIT


@nb.njit(nogil=True, cache=True, inline="always")
def lobe_density(pattern, level, band, cos_theta_d):  # type: ignore[no-untyped-def]
    """Mean density of all N rays of a point in a band, per steradian of wi.

    Args:
        pattern: a `LobePattern`. level: roughness level. band: from `lobe_ray`. cos_theta_d: cosine wi · h.
    """
    num_rays, num_bands = np.float32(pattern.uv.shape[0]), pattern.band_density.shape[1]
    if pattern.angles.shape[0] == 1:
        density = num_rays * pattern.band_density[level, band]
    else:
        first, second = band // num_bands, band % num_bands
        density = num_rays * pattern.band_density[2 * level, first] * pattern.band_density[2 * level + 1, second]
        sines = _ONE - pattern.squared_sine[first] * pattern.squared_sine[second]
        density *= sines * np.float32(math.sqrt(sines))
    return density / (_FOUR * max(cos_theta_d, _MIN_COSINE)) if pattern.is_half_angle else density
