"""Suns: light of a map that comes from so small a place, and so strong, that the edges of its shadows are seen.

A sun is what a few degrees of a map have above what is about them. It is taken out of the map, and comes from a few
directions spread over it as its light is; what is left of the map is smooth enough for points on surfaces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.environments.equirect import texel_directions, texel_solid_angles, uv_to_direction

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

TURNS, NUM_TARGETS = 9, 16  # sets of directions, one for each of 3 × 3 pixels; directions of each
MOST_SUNS = 2
_LEAST_SHARE = 0.05  # of all light of the map
_BRIGHT = 100.0  # times the mean radiance
_MOST_AROUND = 0.2  # of a sun's light
_ROUNDS = 3
_PLASTIC = 1.3247179572447460  # x³ = x + 1: steps of Roberts' R2 sequence


class Bounds(NamedTuple):
    """What is a sun.

    Attributes:
        near, around: angles from what is brightest: the sun's, and where no more may be; degrees.
        widest: root mean square of a sun's angles from its middle, degrees.
    """

    near: float
    around: float
    widest: float


SUNS = Bounds(2.5, 5.0, 1.25)  # of what is wider points know the shadows
LAMPS = Bounds(4.0, 8.0, 3.0)  # what a highlight shows as itself, narrower than itself


class Sun(NamedTuple):
    """One of them.

    Attributes:
        irradiance: ∫ L dω, of each channel. (3,)
        mean: Σ ω L / Σ L, luminous; shorter than one by as much as the sun is wide. (3,)
        towards: unit directions, each with an equal share of the light. (`TURNS`, `NUM_TARGETS`, 3)
    """

    irradiance: F64
    mean: F64
    towards: F64


class Divided(NamedTuple):
    """A map without its suns. beside: radiance. (height, width, 3) float32"""

    suns: tuple[Sun, ...]
    beside: F32


class _Texels(NamedTuple):
    """The bright ones of a map. rows, columns: (n,). directions: unit. (n, 3). luminous: L dω. (n,)"""

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    directions: F64
    luminous: F64


def without_suns(radiance: F32, bounds: Bounds = SUNS) -> Divided:
    """Take the suns out of a map.

    Args:
        radiance: equirectangular, top row first. (height, width, 3) float32
        bounds: what is a sun.
    """
    height, width, _ = radiance.shape
    solid_angles, light = texel_solid_angles(height, width), luminance(radiance).astype(np.float64)
    total = float((light * solid_angles[:, None]).sum())
    rows, columns = np.nonzero(light > _BRIGHT * total / (4 * np.pi))
    directions = uv_to_direction((columns + 0.5) / width, (rows + 0.5) / height)
    bright = _Texels(rows, columns, directions, light[rows, columns] * solid_angles[rows])
    beside, suns, is_left = radiance, list[Sun](), np.ones(len(rows), np.bool_)
    for _ in range(2 * MOST_SUNS):
        if len(suns) == MOST_SUNS or not is_left.any():
            break
        is_in, is_about = _about_brightest(bright, is_left, bounds)
        of_sun, about = bright.luminous[is_in].sum(), bright.luminous[is_about].sum()
        is_left &= ~(is_in | is_about)
        if of_sun < _LEAST_SHARE * total or about > _MOST_AROUND * of_sun:
            continue
        lowered, excess = _taken_out(beside, bright, is_in, bounds)
        sun = _sun(bright, is_in, excess * solid_angles[bright.rows[is_in], None], (height, width))
        if 2 * (1 - np.linalg.norm(sun.mean)) < np.radians(bounds.widest) ** 2:
            suns.append(sun)
            beside = lowered
    return Divided(tuple(suns), beside)


def _about_brightest(
    bright: _Texels, is_left: NDArray[np.bool_], bounds: Bounds
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Find what is about the most light of all that is left: within a sun's radius, and in the ring round it."""
    axis = bright.directions[np.argmax(np.where(is_left, bright.luminous, -1))]
    near, around = np.cos(np.radians(bounds[:2]))
    for _ in range(_ROUNDS):
        is_in = is_left & (bright.directions @ axis > near)
        axis = bright.luminous[is_in] @ bright.directions[is_in]
        axis /= np.linalg.norm(axis)
    cosine = bright.directions @ axis
    is_in = is_left & (cosine > near)
    return is_in, is_left & (cosine > around) & ~is_in


def _taken_out(radiance: F32, bright: _Texels, is_in: NDArray[np.bool_], bounds: Bounds) -> tuple[F32, F64]:
    """Lower texels to what is about them. Returns the map, and by how much they were lowered: (n, 3)."""
    height, width, _ = radiance.shape
    axis = bright.luminous[is_in] @ bright.directions[is_in]
    is_about = texel_directions(height, width) @ (axis / np.linalg.norm(axis)) > np.cos(np.radians(bounds.around))
    rows, columns = bright.rows[is_in], bright.columns[is_in]
    is_about[bright.rows, bright.columns] = False
    around = radiance[is_about].mean(axis=0) if is_about.any() else np.zeros(3)
    before = radiance[rows, columns].astype(np.float64)
    out = radiance.copy()
    out[rows, columns] = np.minimum(before, around)
    return out, before - out[rows, columns]


def _sun(bright: _Texels, is_in: NDArray[np.bool_], light: F64, size: tuple[int, int]) -> Sun:
    """Sum texels up. light: of each, L dω. (n, 3). size: height and width of the map"""
    rows, columns, luminous = bright.rows[is_in], bright.columns[is_in], luminance(light.astype(np.float32))
    mean = luminous @ bright.directions[is_in] / luminous.sum()
    backwards = np.where(rows % 2 == 0, columns, -columns)  # there and back again: what follows lies beside
    order = np.lexsort((backwards, rows))
    ends, num = np.cumsum(luminous[order]), TURNS * NUM_TARGETS
    which = order[np.searchsorted(ends, (np.arange(num) + 0.5) / num * ends[-1])]
    x, y = ((np.arange(num) + 1) / _PLASTIC) % 1, ((np.arange(num) + 1) / _PLASTIC**2) % 1
    directions = uv_to_direction((columns[which] + x) / size[1], (rows[which] + y) / size[0])
    return Sun(light.sum(axis=0), mean, directions.reshape(NUM_TARGETS, TURNS, 3).transpose(1, 0, 2))
