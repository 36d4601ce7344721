"""The shape of a highlight: what it sends of light from each direction, in a table about the mirror direction.

    f(ωi) cos θi / a = T(x, ψ) / (x_h + α²)²,   x = |ωi − ωr|²,   x_h = |ωh − n|²,   ωr the mirror direction

T is flat where f falls off like a distribution of microfacets, so that a few numbers tell it: two to an octave of x,
between which it is linear in x, and six to half a turn of ψ, about ωr from the plane of the eye and the normal.

Lights are as wide as they are. Of each width that they have there is a table, blurred by it; and where a highlight is
narrower than most lights, the two round lobes that stand for it (`relume.moving.basis.lobes`) show the sky more sharply
than lights do: what these are believed, 1 − β, is taken out of the table, blurred by as much
(docs/adr/0100-highlights-by-the-brdf.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.moving.basis.out_factors import cosines

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

LEAST_EXPONENT = -24  # of two: x below which highlights are flat
NUM_RINGS, NUM_SPOKES = 2 * (2 - LEAST_EXPONENT) + 1, 6
NUM_PLACES = NUM_RINGS * NUM_SPOKES
WIDTHS = 0.003, 0.01, 0.025, 0.06, 0.15  # σ of lights along an axis, radians, that there is a table for
_BELIEVED = 0.035, 0.105  # σ of lobes up to which they are, and from which on they are not
_FAR = 0.25  # of the peak, which a distribution of microfacets has where x_h = α²
_LEAST_FLATNESS = 0.002  # below, rows of grazing eyes have nothing in common with those beside them
_MIDDLE_ROW = int(np.abs(cosines() - 0.7).argmin())


class Shapes(NamedTuple):
    """Of some highlights.

    Attributes:
        tables: T of each width of lights, less what lobes are believed. (n, `NUM_ROWS`, widths, `NUM_PLACES`) float32
        flatness: α². (n,) float32
        believed: 1 − β. (n, `NUM_ROWS`) float32
    """

    tables: F32
    flatness: F32
    believed: F32


def rings() -> F64:
    """x of the rings of a table. (`NUM_RINGS`,)"""
    k = np.arange(NUM_RINGS)
    return np.asarray(2.0 ** (LEAST_EXPONENT + k // 2) * (1 + (k % 2) / 2), np.float64)


def spokes() -> F64:
    """ψ of its spokes. (`NUM_SPOKES`,)"""
    return np.asarray((np.arange(NUM_SPOKES) + 0.5) * (np.pi / NUM_SPOKES), np.float64)


@lru_cache(maxsize=1)
def places() -> F64:
    """Places of a table about a pole, with x in the plane of the eye. (`NUM_PLACES`, 3)"""
    away, psi = 2 * np.arcsin(np.sqrt(rings()) / 2)[:, None], spokes()
    found = np.stack(np.broadcast_arrays(np.sin(away) * np.cos(psi), np.sin(away) * np.sin(psi), np.cos(away)), axis=-1)
    return np.asarray(found.reshape(-1, 3))


def about_mirror(away: F64, phi: float) -> tuple[F64, F64]:
    """Turn directions about a pole to the mirror directions of eyes in all rows.

    Args:
        away: unit. (n, 3). phi: φo of the eyes.
    Returns:
        ωi (rows, n, 3), and ωo (rows, 1, 3).
    """
    cosine, aside = cosines()[:, None], np.array([np.cos(phi), np.sin(phi), 0.0])
    sine = np.sqrt(1 - cosine**2)
    wo = sine * aside + cosine * [0, 0, 1]
    across = np.broadcast_to([-np.sin(phi), np.cos(phi), 0.0], wo.shape)
    wi = away @ np.stack([cosine * aside + sine * [0, 0, 1], across, cosine * [0, 0, 1] - sine * aside], axis=1)
    return wi, wo[:, None]


@lru_cache(maxsize=1)
def _off_normal() -> F64:
    """x_h at all places. (rows, `NUM_PLACES`)"""
    wi, wo = about_mirror(places(), 0.0)
    half = wi + wo
    cosine = half[..., 2] / np.maximum(np.linalg.norm(half, axis=-1), 1e-9)
    return np.asarray(np.maximum(2 - 2 * cosine, 0))


@lru_cache(maxsize=1)
def _areas() -> F64:
    """dω of all places, both sides of the plane of the eye together. (`NUM_PLACES`,)"""
    x = rings()
    edges = np.concatenate([[0], (x[1:] + x[:-1]) / 2, [4]])  # in x, which areas are proportional to
    return np.asarray(np.repeat(np.diff(edges) * (np.pi / NUM_SPOKES), NUM_SPOKES), np.float64)


@lru_cache(maxsize=1)
def _blurs() -> F32:
    """What blurs a table by each width. (`NUM_PLACES`, widths · `NUM_PLACES`) float32"""
    at, area = places(), _areas()
    other_side = at * [1, -1, 1]
    found = []
    for width in WIDTHS:
        kernel = sum(np.exp((at @ side.T - 1) / width**2) for side in (at, other_side)) * area
        found.append((kernel / kernel.sum(axis=1, keepdims=True)).T)
    return np.concatenate(found, axis=1).astype(np.float32)


def shapes_of(sent: Sequence[F64], lobes: Sequence[F64], is_told: NDArray[np.bool_]) -> Shapes:
    """Make the tables of highlights.

    Args:
        sent: of each, f cos θi / a at all places. (rows, `NUM_PLACES`)
        lobes: that stand for it: cos θ of both, s_1, σ of both. (rows, 5)
        is_told: whether the in-basis tells it, and its table is not asked for. (n,)
    """
    num, num_rows = len(sent), len(cosines())
    tables = np.zeros((num, num_rows, len(WIDTHS), NUM_PLACES), np.float32)
    flatness, believed = np.ones(num, np.float32), np.ones((num, num_rows), np.float32)
    for k in np.flatnonzero(~is_told).tolist():
        tables[k], flatness[k], believed[k] = _shape_of(sent[k], lobes[k])
    return Shapes(tables, flatness, believed)


def _shape_of(sent: F64, lobes: F64) -> tuple[F32, float, F64]:
    """Make that of one: T (rows, widths, `NUM_PLACES`), α², 1 − β (rows,)."""
    low, high = _BELIEVED
    share = np.clip((lobes[:, 3:].min(axis=1) - low) / (high - low), 0, 1)
    believed, flatness = 1 - share**2 * (3 - 2 * share), _flatness(sent)
    left = sent.astype(np.float32)
    if believed.any():
        by_lobes, area = _of_lobes(lobes), _areas()
        alike = (sent @ area) / np.maximum(by_lobes @ area, 1e-30)  # neither is told well where all is in a ring
        left -= (believed * alike)[:, None] * by_lobes
    blurred = (left @ _blurs()).reshape(-1, len(WIDTHS), NUM_PLACES)
    flat = np.square(_off_normal() + flatness).astype(np.float32)
    return blurred * flat[:, None], flatness, believed


def _flatness(sent: F64) -> float:
    """Find α², or more: x_h where a highlight has fallen to a quarter, from somewhat aslant. sent: (rows, places)"""
    mean = sent[_MIDDLE_ROW].reshape(NUM_RINGS, NUM_SPOKES).mean(axis=1)
    off = _off_normal()[_MIDDLE_ROW].reshape(NUM_RINGS, NUM_SPOKES).mean(axis=1)
    return max(float(off[np.argmax(mean < _FAR * mean[0])]), _LEAST_FLATNESS)


@lru_cache(maxsize=1)
def _in_plane() -> tuple[F64, F64]:
    """Of all places, how far they are away from the eye along the surface, and up. (rows, `NUM_PLACES`) each"""
    wi, _ = about_mirror(places(), 0.0)
    return -wi[..., 0], wi[..., 2]


def _of_lobes(lobes: F64) -> F64:
    """What two round lobes have at all places. lobes: (rows, 5). (rows, `NUM_PLACES`)"""
    (x, z), total = _in_plane(), np.zeros((len(lobes), NUM_PLACES))
    first = lobes[:, 2]
    for cosine, share, sigma in ((lobes[:, 0], first, lobes[:, 3]), (lobes[:, 1], 1 - first, lobes[:, 4])):
        kappa = 1 / sigma**2
        peak = share * kappa / (2 * np.pi * -np.expm1(-2 * kappa))
        sine = np.sqrt(np.maximum(1 - cosine**2, 0))
        off = 1 - sine[:, None] * x - cosine[:, None] * z
        total += peak[:, None] * np.exp(-kappa[:, None] * off)
    return total
