"""Shapes of highlights: tables of reflected light per incident direction around the mirror direction.

    f(ωi) cos θi / a = T(x, ψ) / (x_h + α²)²,   x = |ωi − ωr|²,   x_h = |ωh − n|²,   ωr the mirror direction

T is smooth if f falls off like a microfacet distribution, so few values represent it: two per octave of x, with linear
interpolation in x, and six per half turn of ψ, the azimuth around ωr from the plane of view direction and normal.

Lights have a width, so there is a table per width of lights, blurred by it. Highlights that are narrower than most
lights are rendered by the two lobes (`relume.live.free_camera.basis.highlight_lobes`), which show the environment more
sharply: their fraction 1 − β is subtracted from the table, blurred likewise (docs/free-camera.md#highlights).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.free_camera.basis.outgoing_coefficients import cosines

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MIN_EXPONENT = -24  # of 2: x below which highlights are flat
NUM_RINGS, NUM_AZIMUTHS = 2 * (2 - MIN_EXPONENT) + 1, 6
NUM_GRID_DIRECTIONS = NUM_RINGS * NUM_AZIMUTHS
WIDTHS = 0.003, 0.01, 0.025, 0.06, 0.15  # σ of lights along an axis, radians, one table each
_LOBE_CONFIDENCE_WIDTHS = 0.035, 0.105  # σ of lobes: full confidence up to the first, none from the second on
_PEAK_FRACTION = 0.25  # of the peak; a microfacet distribution has it at x_h = α²
_MIN_FLATNESS = 0.002  # below, adjacent rows at grazing angles cannot be interpolated
_MIDDLE_ROW = int(np.abs(cosines() - 0.7).argmin())


class LobeShapes(NamedTuple):
    """The shapes of some highlights.

    Attributes:
        tables: T for each width of lights, without the fraction of the lobes.
        flatness: α².
        lobe_confidence: 1 − β.
    """

    tables: Shaped[F32, "n rows widths directions"]
    flatness: Shaped[F32, " n"]
    lobe_confidence: Shaped[F32, "n rows"]


def ring_distances() -> Shaped[F64, " rings"]:
    """Return x of the rings of a table."""
    k = np.arange(NUM_RINGS)
    return np.asarray(2.0 ** (MIN_EXPONENT + k // 2) * (1 + (k % 2) / 2), np.float64)


def ring_azimuths() -> Shaped[F64, " azimuths"]:
    """Return ψ of the azimuths of a table."""
    return np.asarray((np.arange(NUM_AZIMUTHS) + 0.5) * (np.pi / NUM_AZIMUTHS), np.float64)


@lru_cache(maxsize=1)
def grid_directions() -> F64:
    """Return the grid directions of a table around a pole, with x in the plane of the view direction."""
    ring_angle, psi = 2 * np.arcsin(np.sqrt(ring_distances()) / 2)[:, None], ring_azimuths()
    directions = np.stack(
        np.broadcast_arrays(np.sin(ring_angle) * np.cos(psi), np.sin(ring_angle) * np.sin(psi), np.cos(ring_angle)),
        axis=-1,
    )
    return np.asarray(directions.reshape(-1, 3))


def rotate_to_mirror(
    directions: Shaped[F64, "n 3"], phi: float
) -> tuple[Shaped[F64, "rows n 3"], Shaped[F64, "rows 1 3"]]:
    """Rotate directions around a pole to the mirror directions of all rows.

    Args:
        directions: unit. phi: φo of the view directions.
    Returns:
        ωi and ωo.
    """
    cosine, azimuth_direction = cosines()[:, None], np.array([np.cos(phi), np.sin(phi), 0.0])
    sine = np.sqrt(1 - cosine**2)
    wo = sine * azimuth_direction + cosine * [0, 0, 1]
    across = np.broadcast_to([-np.sin(phi), np.cos(phi), 0.0], wo.shape)
    wi = directions @ np.stack(
        [cosine * azimuth_direction + sine * [0, 0, 1], across, cosine * [0, 0, 1] - sine * azimuth_direction], axis=1
    )
    return wi, wo[:, None]


@lru_cache(maxsize=1)
def _half_vector_distances() -> F64:
    """x_h at all grid directions. (rows, `NUM_GRID_DIRECTIONS`)"""
    wi, wo = rotate_to_mirror(grid_directions(), 0.0)
    half = wi + wo
    cosine = half[..., 2] / np.maximum(np.linalg.norm(half, axis=-1), 1e-9)
    return np.asarray(np.maximum(2 - 2 * cosine, 0))


@lru_cache(maxsize=1)
def _grid_solid_angles() -> F64:
    """dω of all grid directions, both sides of the plane of incidence together. (`NUM_GRID_DIRECTIONS`,)"""
    x = ring_distances()
    edges = np.concatenate([[0], (x[1:] + x[:-1]) / 2, [4]])  # in x, which is proportional to area
    return np.asarray(np.repeat(np.diff(edges) * (np.pi / NUM_AZIMUTHS), NUM_AZIMUTHS), np.float64)


@lru_cache(maxsize=1)
def _blur_kernels() -> F32:
    """Kernels that blur a table by each width. (`NUM_GRID_DIRECTIONS`, widths · `NUM_GRID_DIRECTIONS`) float32"""
    directions, area = grid_directions(), _grid_solid_angles()
    mirrored = directions * [1, -1, 1]
    kernels = []
    for width in WIDTHS:
        kernel = sum(np.exp((directions @ side.T - 1) / width**2) for side in (directions, mirrored)) * area
        kernels.append((kernel / kernel.sum(axis=1, keepdims=True)).T)
    return np.concatenate(kernels, axis=1).astype(np.float32)


def build_shapes(
    grid_densities: Sequence[F64], lobes: Sequence[F64], is_representable: Shaped[NDArray[np.bool_], " n"]
) -> LobeShapes:
    """Build the tables of highlights.

    Args:
        grid_densities: grid densities of each, f cos θi / a at all grid directions. (rows, `NUM_GRID_DIRECTIONS`)
        lobes: two lobes of each: cos θ of both, s_1, σ of both. (rows, 5)
        is_representable: the basis represents it, so it needs no table.
    """
    num, num_rows = len(grid_densities), len(cosines())
    tables = np.zeros((num, num_rows, len(WIDTHS), NUM_GRID_DIRECTIONS), np.float32)
    flatness, lobe_confidence = np.ones(num, np.float32), np.ones((num, num_rows), np.float32)
    for k in np.flatnonzero(~is_representable).tolist():
        tables[k], flatness[k], lobe_confidence[k] = _build_shape(grid_densities[k], lobes[k])
    return LobeShapes(tables, flatness, lobe_confidence)


def _build_shape(grid_density: F64, lobes: F64) -> tuple[F32, float, F64]:
    """Build one shape: T (rows, widths, `NUM_GRID_DIRECTIONS`), α², 1 − β (rows,)."""
    low, high = _LOBE_CONFIDENCE_WIDTHS
    blend = np.clip((lobes[:, 3:].min(axis=1) - low) / (high - low), 0, 1)
    lobe_confidence, flatness = 1 - blend**2 * (3 - 2 * blend), _flatness(grid_density)
    remainder = grid_density.astype(np.float32)
    if lobe_confidence.any():
        lobe_density, area = _lobe_density(lobes), _grid_solid_angles()
        # normalize: both sums are inaccurate if a single ring holds all energy
        scale = (grid_density @ area) / np.maximum(lobe_density @ area, 1e-30)
        remainder -= (lobe_confidence * scale)[:, None] * lobe_density
    blurred = (remainder @ _blur_kernels()).reshape(-1, len(WIDTHS), NUM_GRID_DIRECTIONS)
    flat = np.square(_half_vector_distances() + flatness).astype(np.float32)
    return blurred * flat[:, None], flatness, lobe_confidence


def _flatness(grid_density: F64) -> float:
    """Estimate α², bounded below: x_h at which a highlight has fallen to a quarter, at moderate θo."""
    mean = grid_density[_MIDDLE_ROW].reshape(NUM_RINGS, NUM_AZIMUTHS).mean(axis=1)
    half_vector_distance = _half_vector_distances()[_MIDDLE_ROW].reshape(NUM_RINGS, NUM_AZIMUTHS).mean(axis=1)
    return max(float(half_vector_distance[np.argmax(mean < _PEAK_FRACTION * mean[0])]), _MIN_FLATNESS)


@lru_cache(maxsize=1)
def _in_plane() -> tuple[F64, F64]:
    """Components of all grid directions along the view and up. (rows, `NUM_GRID_DIRECTIONS`) each"""
    wi, _ = rotate_to_mirror(grid_directions(), 0.0)
    return -wi[..., 0], wi[..., 2]


def _lobe_density(lobes: F64) -> F64:
    """Density of two lobes at all grid directions. lobes: (rows, 5). (rows, `NUM_GRID_DIRECTIONS`)"""
    (x, z), total = _in_plane(), np.zeros((len(lobes), NUM_GRID_DIRECTIONS))
    first = lobes[:, 2]
    for cosine, lobe_weight, sigma in ((lobes[:, 0], first, lobes[:, 3]), (lobes[:, 1], 1 - first, lobes[:, 4])):
        kappa = 1 / sigma**2
        peak = lobe_weight * kappa / (2 * np.pi * -np.expm1(-2 * kappa))
        sine = np.sqrt(np.maximum(1 - cosine**2, 0))
        off = 1 - sine[:, None] * x - cosine[:, None] * z
        total += peak[:, None] * np.exp(-kappa[:, None] * off)
    return total
