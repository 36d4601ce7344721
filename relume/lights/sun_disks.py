"""Sun disks: small regions of an environment so bright that they cast sharp shadows.

A sun disk is the excess of a region of a few degrees over its surroundings. It is subtracted from the map and
represented by a few directions distributed like its light; the remaining map is smooth enough for surface probes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import texel_directions, texel_solid_angles, uv_to_direction
from relume.core.color import luminance

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NUM_TARGET_SETS, NUM_TARGETS = 9, 16  # sets of directions, one per pixel of 3 × 3; directions per set
MAX_SUN_DISKS = 2
_MIN_LIGHT_FRACTION = 0.05  # of all light of the map
_BRIGHTNESS_FACTOR = 100.0  # times the mean radiance
_MAX_SURROUNDING_FRACTION = 0.2  # of a sun disk's light
_NUM_ROUNDS = 3
_PLASTIC = 1.3247179572447460  # x³ = x + 1: steps of Roberts' R2 sequence


class SunBounds(NamedTuple):
    """Criteria of a sun disk.

    Attributes:
        inner_angle, outer_angle: radius of the disk, and of the dark ring around it, degrees.
        max_spread: root mean square of the angles to the disk's center, degrees.
    """

    inner_angle: float
    outer_angle: float
    max_spread: float


SUN_BOUNDS = SunBounds(2.5, 5.0, 1.25)  # probes resolve the shadows of wider regions
BRIGHT_LIGHT_BOUNDS = SunBounds(4.0, 8.0, 3.0)  # narrower than highlights, which show these lights individually


class SunDisk(NamedTuple):
    """A sun disk.

    Attributes:
        irradiance: ∫ L dω, per channel.
        mean: mean direction Σ ω L / Σ L, weighted by luminance; the wider the disk, the shorter the vector.
        directions: unit directions with equal fractions of the light.
    """

    irradiance: Shaped[F64, " 3"]
    mean: Shaped[F64, " 3"]
    directions: Shaped[F64, "sets targets 3"]


class SplitEnvironment(NamedTuple):
    """Sun disks of a map, and the remaining radiance."""

    sun_disks: tuple[SunDisk, ...]
    residual: Shaped[F32, "height width 3"]


class _BrightTexels(NamedTuple):
    """Bright texels of a map. directions: unit. luminous: L dω."""

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    directions: F64
    luminous: F64


def remove_sun_disks(radiance: Shaped[F32, "height width 3"], bounds: SunBounds = SUN_BOUNDS) -> SplitEnvironment:
    """Extract the sun disks of a map.

    Args:
        radiance: equirectangular, top row first. bounds: criteria of a disk.
    """
    height, width, _ = radiance.shape
    solid_angles, light = texel_solid_angles(height, width), luminance(radiance).astype(np.float64)
    total = float((light * solid_angles[:, None]).sum())
    rows, columns = np.nonzero(light > _BRIGHTNESS_FACTOR * total / (4 * np.pi))
    directions = uv_to_direction((columns + 0.5) / width, (rows + 0.5) / height)
    bright = _BrightTexels(rows, columns, directions, light[rows, columns] * solid_angles[rows])
    residual, sun_disks, is_remaining = radiance, list[SunDisk](), np.ones(len(rows), np.bool_)
    for _ in range(2 * MAX_SUN_DISKS):
        if len(sun_disks) == MAX_SUN_DISKS or not is_remaining.any():
            break
        is_inside, is_surrounding = _find_brightest_region(bright, is_remaining, bounds)
        sun_light, surrounding_light = bright.luminous[is_inside].sum(), bright.luminous[is_surrounding].sum()
        is_remaining &= ~(is_inside | is_surrounding)
        if sun_light < _MIN_LIGHT_FRACTION * total or surrounding_light > _MAX_SURROUNDING_FRACTION * sun_light:
            continue
        new_residual, excess = _remove_excess(residual, bright, is_inside, bounds)
        sun_disk = _make_sun_disk(
            bright, is_inside, excess * solid_angles[bright.rows[is_inside], None], (height, width)
        )
        if 2 * (1 - np.linalg.norm(sun_disk.mean)) < np.radians(bounds.max_spread) ** 2:
            sun_disks.append(sun_disk)
            residual = new_residual
    return SplitEnvironment(tuple(sun_disks), residual)


def _find_brightest_region(
    bright: _BrightTexels, is_remaining: NDArray[np.bool_], bounds: SunBounds
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Find the region with the most remaining light: masks of the disk, and of the ring around it."""
    axis = bright.directions[np.argmax(np.where(is_remaining, bright.luminous, -1))]
    cos_inner, cos_outer = np.cos(np.radians(bounds[:2]))
    for _ in range(_NUM_ROUNDS):
        is_inside = is_remaining & (bright.directions @ axis > cos_inner)
        axis = bright.luminous[is_inside] @ bright.directions[is_inside]
        axis /= np.linalg.norm(axis)
    cosine = bright.directions @ axis
    is_inside = is_remaining & (cosine > cos_inner)
    return is_inside, is_remaining & (cosine > cos_outer) & ~is_inside


def _remove_excess(
    radiance: F32, bright: _BrightTexels, is_inside: NDArray[np.bool_], bounds: SunBounds
) -> tuple[F32, F64]:
    """Reduce texels to their surroundings. Returns the map, and the removed radiance (n, 3)."""
    height, width, _ = radiance.shape
    axis = bright.luminous[is_inside] @ bright.directions[is_inside]
    is_surrounding = texel_directions(height, width) @ (axis / np.linalg.norm(axis)) > np.cos(
        np.radians(bounds.outer_angle)
    )
    rows, columns = bright.rows[is_inside], bright.columns[is_inside]
    is_surrounding[bright.rows, bright.columns] = False
    surrounding_radiance = radiance[is_surrounding].mean(axis=0) if is_surrounding.any() else np.zeros(3)
    original = radiance[rows, columns].astype(np.float64)
    out = radiance.copy()
    out[rows, columns] = np.minimum(original, surrounding_radiance)
    return out, original - out[rows, columns]


def _make_sun_disk(bright: _BrightTexels, is_inside: NDArray[np.bool_], light: F64, size: tuple[int, int]) -> SunDisk:
    """Build a disk from its texels. light: light of each texel, L dω. (n, 3). size: height and width of the map"""
    rows, columns, luminous = bright.rows[is_inside], bright.columns[is_inside], luminance(light.astype(np.float32))
    mean = luminous @ bright.directions[is_inside] / luminous.sum()
    serpentine = np.where(rows % 2 == 0, columns, -columns)  # alternating direction: successive texels are adjacent
    order = np.lexsort((serpentine, rows))
    cumulative, num_samples = np.cumsum(luminous[order]), NUM_TARGET_SETS * NUM_TARGETS
    texel = order[np.searchsorted(cumulative, (np.arange(num_samples) + 0.5) / num_samples * cumulative[-1])]
    x, y = ((np.arange(num_samples) + 1) / _PLASTIC) % 1, ((np.arange(num_samples) + 1) / _PLASTIC**2) % 1
    directions = uv_to_direction((columns[texel] + x) / size[1], (rows[texel] + y) / size[0])
    return SunDisk(light.sum(axis=0), mean, directions.reshape(NUM_TARGETS, NUM_TARGET_SETS, 3).transpose(1, 0, 2))
