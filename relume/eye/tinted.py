"""Light that comes through tinted glass: a view sample that it reaches is three, of one channel each.

A sample knows of a light whether it sees it or not, one bit, and glass is passed by chance; to samples of a channel, by
the chance of that channel. So shadows of tinted glass have its colour, whatever the light and the look will be, and
nothing that sums light knows of it (docs/adr/0094-samples-of-a-channel.md).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.light.triangles import subdivide
from relume.parallel import for_ranges
from relume.points import ALIKE, Points
from relume.scene.model import Material
from relume.trace.coherent import targets_of, trace_coherent
from relume.trace.cutout_filter import OF_CHANNEL, PAST_GLASS, TO_TINTED
from relume.trace.cutouts import is_tinted
from relume.trace.geometry import Geometry

F32 = NDArray[np.float32]

NUM_CHANNELS = 3
_LIGHTS = 200  # that are asked for
RAYS_TO_TINTED = 2 * _LIGHTS  # of each sample, at most
_POINTS_A_RANGE = 16_384
_LEAST_SHARE = 0.01  # of the light that is above a sample's horizon; less through tinted glass is grey


def has_tinted_glass(materials: Sequence[Material]) -> bool:
    """Tell whether shadows of any material have a colour."""
    return any(is_tinted(material.glass) for material in materials if material.glass is not None)


def sees_tinted_light(geometry: Geometry, points: Points, radiance: F32) -> tuple[NDArray[np.bool_], int]:
    """Find which points see an environment, or what might shine in its place, through tinted glass.

    Args:
        geometry: the triangles. points: n of them, neighbours mostly next to each other.
        radiance: equirectangular, top row first. (height, width, 3) float32
    Returns:
        (n,), and how many rays that took.
    """
    anywhere = float(radiance.mean(dtype=np.float64)) or 1.0  # as lamps and surfaces may be in any direction
    lights = subdivide(radiance + np.float32(anywhere), _LIGHTS)
    targets = targets_of(lights.direction, lights.irradiance)
    weight = luminance(lights.irradiance)
    past, to_tinted = (
        trace_coherent(geometry.embree, points.position, points.normal, targets, np.full(1, chance))
        for chance in (PAST_GLASS, TO_TINTED)
    )
    found = np.zeros(points.num_points, np.bool_)

    def judge(start: int, stop: int) -> None:
        passed = past.visible[start:stop] & ~to_tinted.visible[start:stop]
        share = np.unpackbits(passed, axis=1, count=len(weight), bitorder="little") @ weight
        above = (points.normal[start:stop] @ lights.direction.T > 0) @ weight
        found[start:stop] = share > _LEAST_SHARE * above

    for_ranges(judge, points.num_points, _POINTS_A_RANGE)
    return found, past.rays.traced + to_tinted.rays.traced


def parted(is_lit: NDArray[np.bool_]) -> tuple[NDArray[np.intp], F32]:
    """Make three samples of some.

    Args:
        is_lit: which. (n,)
    Returns:
        Of which each of the new ones is made, (m,), ascending; and what each shows of a channel, (m, 3): of those of
        one, three times as much, as each of the three has a third of the share of their pixel.
    """
    rows = np.repeat(np.arange(len(is_lit)), np.where(is_lit, NUM_CHANNELS, 1))
    first = np.cumsum(np.where(is_lit, NUM_CHANNELS, 1)) - np.where(is_lit, NUM_CHANNELS, 1)
    shown = np.ones((len(rows), NUM_CHANNELS), np.float32)
    for channel in range(NUM_CHANNELS):
        shown[first[is_lit] + channel] = NUM_CHANNELS * np.eye(NUM_CHANNELS, dtype=np.float32)[channel]
    return rows, shown


def chance_of(through: F32) -> F32:
    """The chance of the rays of samples, by what of each channel comes through to the eye. (n, 3) -> (n,) or (1,)"""
    is_there = through > 0
    if not (is_alone := is_there.sum(axis=1) == 1).any():
        return ALIKE
    return np.where(is_alone, OF_CHANNEL[is_there.argmax(axis=1)], ALIKE).astype(np.float32)
