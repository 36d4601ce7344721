"""Light that comes through tinted glass: a view sample that it reaches is three, of one channel each.

A sample knows of a light whether it sees it or not, one bit, and glass is passed by chance; to samples of a channel, by
the chance of that channel. So shadows of tinted glass have its colour, whatever the light and the look will be, and
nothing that sums light knows of it (docs/adr/0094-samples-of-a-channel.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.eye.sorted_rows import Column
from relume.light.triangles import subdivide
from relume.parallel import for_ranges
from relume.points import ALIKE
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
POINTS_A_BLOCK = 4 * _POINTS_A_RANGE
ALL = -1  # of a sample that shows all channels
_LEAST_SHARE = 0.01  # of the light that is above a sample's horizon; less through tinted glass is grey


def has_tinted_glass(materials: Sequence[Material]) -> bool:
    """Tell whether shadows of any material have a colour."""
    return any(is_tinted(material.glass) for material in materials if material.glass is not None)


class TintedLight:
    """What of an environment, or of what might shine in its place, may come through tinted glass.

    Args:
        geometry: the triangles. radiance: equirectangular, top row first. (height, width, 3) float32
    """

    def __init__(self, geometry: Geometry, radiance: F32) -> None:
        anywhere = float(radiance.mean(dtype=np.float64)) or 1.0  # as lamps and surfaces may be in any direction
        lights = subdivide(radiance + np.float32(anywhere), _LIGHTS)
        self._geometry, self._directions = geometry, lights.direction
        self._targets, self._weight = targets_of(lights.direction, lights.irradiance), luminance(lights.irradiance)

    def reaches(self, position: F32, normal: F32) -> tuple[NDArray[np.bool_], int]:
        """Find which points it comes to.

        Args:
            position, normal: of n points, neighbours mostly next to each other. (n, 3) each. What is found of them does
                not change where others are left out by blocks of `POINTS_A_BLOCK`.
        Returns:
            (n,), and how many rays that took.
        """
        past, to_tinted = (
            trace_coherent(self._geometry.embree, position, normal, self._targets, np.full(1, chance))
            for chance in (PAST_GLASS, TO_TINTED)
        )
        found = np.zeros(len(position), np.bool_)

        def judge(start: int, stop: int) -> None:
            passed = past.visible[start:stop] & ~to_tinted.visible[start:stop]
            share = np.unpackbits(passed, axis=1, count=len(self._weight), bitorder="little") @ self._weight
            above = (normal[start:stop] @ self._directions.T > 0) @ self._weight
            found[start:stop] = share > _LEAST_SHARE * above

        for_ranges(judge, len(position), _POINTS_A_RANGE)
        return found, past.rays.traced + to_tinted.rays.traced


class Parted(NamedTuple):
    """Samples of which some are three, of one channel each.

    Attributes:
        row: of which each is made. (m,) uint32. channel: that it shows alone, `ALL` where it shows all. (m,) int8
    """

    row: NDArray[np.uint32]
    channel: NDArray[np.int8]

    @property
    def shown(self) -> F32:
        """What each shows of the channels: three times as much, as each of three has a third of the share of their
        pixel. (m, 3)"""
        of_channel = NUM_CHANNELS * np.eye(NUM_CHANNELS, dtype=np.float32)
        return np.asarray(np.vstack([of_channel, np.ones((1, NUM_CHANNELS), np.float32)])[self.channel])


def parted(is_lit: NDArray[np.bool_], bounds: NDArray[np.integer]) -> Parted:
    """Make three samples of some.

    Args:
        is_lit: which. (n,) bounds: between groups of them that stay together, in which neighbours of one channel
            follow each other; the first is 0, the last n.
    """
    rows, channels = list[NDArray[np.uint32]](), list[NDArray[np.int8]]()
    for start, stop in pairwise(bounds.tolist()):
        lit = np.flatnonzero(is_lit[start:stop]).astype(np.uint32) + np.uint32(start)
        rows += [np.arange(start, stop, dtype=np.uint32), lit, lit]
        channels.append(np.where(is_lit[start:stop], 0, ALL).astype(np.int8))
        channels += [np.full(len(lit), channel, np.int8) for channel in range(1, NUM_CHANNELS)]
    return Parted(np.concatenate(rows), np.concatenate(channels))


class ColumnOfParted:
    """A column of samples of which some were parted, read as `relume.eye.sorted_rows.Column` is.

    Args:
        name: of the column; shares of a pixel, and what glass lets through, change. whole: before. parted: how.
    """

    def __init__(self, name: str, whole: Column, parted: Parted) -> None:
        self._name, self._whole, self._parted = name, whole, parted
        self.dtype, self.shape = whole.dtype, (len(parted.row), *whole.shape[1:])

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        """Some rows that follow each other."""
        of = Parted(self._parted.row[rows], self._parted.channel[rows])
        whole = self._whole.take(of.row)
        if self._name == "weight":
            return np.asarray(whole / of.shown.max(axis=1))
        return np.asarray(whole * of.shown) if self._name == "through" else whole

    def __array__(self, dtype: Any = None) -> NDArray[Any]:
        return np.asarray(self[:], dtype)


def chance_of(through: F32) -> F32:
    """The chance of the rays of samples, by what of each channel comes through to the eye. (n, 3) -> (n,) or (1,)"""
    is_there = through > 0
    if not (is_alone := is_there.sum(axis=1) == 1).any():
        return ALIKE
    return np.where(is_alone, OF_CHANNEL[is_there.argmax(axis=1)], ALIKE).astype(np.float32)
