"""Light that comes through tinted glass: a view sample that it reaches is several, one for each tint and one besides.

A sample and a light have one bit, visible or not. Let P_g be the visibility where glass of the first g groups of tints
lets all pass, and tinted glass of the others stops all. Of the light that P_g and not P_g-1 sees, each channel has the
share T_g, the mean of what the sides of glass let pass on the way. So the visibility is

    V = P_0 + sum_g (P_g - P_g-1) T_g  =  P_0 (1 - T_1) + P_1 (T_1 - T_2) + ... + P_G T_G

in each channel, and each P is that of a sample whose share of the pixel is multiplied by what stands beside it. A lobe
that sees one light sees its tint, and nothing that sums light knows of it
(docs/adr/0094-samples-of-a-channel.md). Brute force does without means: its samples are of one channel each, and their
rays pass by the tint of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.fresnel import schlick
from relume.color import luminance
from relume.eye.sorted_rows import Column
from relume.light.triangles import subdivide
from relume.parallel import for_ranges
from relume.points import ALIKE
from relume.scene.model import Material
from relume.trace.coherent import targets_of, trace_coherent
from relume.trace.cutout_filter import EVERYWHERE, OF_CHANNEL, UP_TO_GROUP
from relume.trace.cutouts import MOST_TINTS, PASSES, is_tinted
from relume.trace.geometry import Geometry
from relume.trace.on_faces import places_on
from relume.trace.primary import trace_from

F32 = NDArray[np.float32]

NUM_CHANNELS = 3
_LIGHTS = 200  # for which visibility is traced
_FOLLOWED = 16  # ways through a group of tints, spread evenly over the light that comes along them
_MAX_SIDES = 16  # of glass on that way
_POINTS_A_RANGE = 4096
POINTS_A_BLOCK = 16 * _POINTS_A_RANGE
_LEAST_SHARE = 0.01  # of the light that is above a sample's horizon; less through tinted glass is gray


def num_tints(materials: Sequence[Material]) -> int:
    """Bound the groups of tints, 0 where no shadow has a color."""
    return min(MOST_TINTS, sum(is_tinted(material.glass) for material in materials if material.glass is not None))


def rays_to_tinted(materials: Sequence[Material]) -> int:
    """Bound the rays that are traced for each sample."""
    num = num_tints(materials)
    return (1 + num) * _LIGHTS + num * _FOLLOWED * _MAX_SIDES if num else 0


class TintedLight:
    """Light of an environment, or of lights in its place, that comes through tinted glass.

    Args:
        geometry: the triangles, some of them of tinted glass.
        radiance: equirectangular, top row first. (height, width, 3) float32
    """

    def __init__(self, geometry: Geometry, radiance: F32) -> None:
        anywhere = float(radiance.mean(dtype=np.float64)) or 1.0  # as lamps and surfaces may be in any direction
        lights = subdivide(radiance + np.float32(anywhere), _LIGHTS)
        self._geometry, self._directions = geometry, lights.direction
        self._targets, self._weight = targets_of(lights.direction, lights.irradiance), luminance(lights.irradiance)
        holes = geometry.embree.holes
        assert holes is not None
        self.num_groups = int(holes.groups.max(initial=0))
        rule = holes.cutouts.of_material
        self._is_glass = (rule >= 0) & (holes.cutouts.rules[rule, 0] == PASSES)
        is_tinted_glass = self._is_glass & (holes.groups[rule] > 0)  # the share of others is in what rays see
        self._tint = np.where(is_tinted_glass[:, None], holes.cutouts.rules[rule, 1:4], np.float32(1))
        self._f0 = np.where(is_tinted_glass, holes.cutouts.rules[rule, 4], np.float32(0))

    def tints(self, position: F32, normal: F32) -> tuple[F32, int]:
        """Find the mean tint of the light that each group lets through to points.

        Args:
            position, normal: of n points, neighbors mostly next to each other. (n, 3) each. What is found for them does
                not change where others are left out by blocks of `POINTS_A_BLOCK`.
        Returns:
            What glass passes of each channel on the way, of light that comes through this group and through none of a
            higher number; NaN where it is too little. (n, groups, 3). How many rays that took.
        """
        seen = [
            trace_coherent(self._geometry.embree, position, normal, self._targets, UP_TO_GROUP[group : group + 1])
            for group in range(self.num_groups + 1)
        ]
        found = np.full((len(position), self.num_groups, NUM_CHANNELS), np.nan, np.float32)
        num_rays = [sum(each.rays.traced for each in seen)]

        def judge(start: int, stop: int) -> None:
            cosine = normal[start:stop] @ self._directions.T
            least = _LEAST_SHARE * ((cosine > 0) @ self._weight)
            for group in range(self.num_groups):
                passed = seen[group + 1].visible[start:stop] & ~seen[group].visible[start:stop]
                bits = np.unpackbits(passed, axis=1, count=len(self._weight), bitorder="little")
                lit = np.flatnonzero(bits @ self._weight > least)
                weight = bits[lit] * np.maximum(cosine[lit], np.float32(1e-6)) * self._weight
                found[start + lit, group], num_traced = self._mean_tint(position[start + lit], weight)
                num_rays.append(num_traced)

        for_ranges(judge, len(position), _POINTS_A_RANGE)
        return found, sum(num_rays)

    def _mean_tint(self, position: F32, weight: F32) -> tuple[F32, int]:
        """Find the mean tint on the ways from points to lights. weight: of each light. (n, lights)"""
        sums = np.cumsum(weight, axis=1, dtype=np.float64)
        steps = sums[:, -1:] * ((np.arange(_FOLLOWED) + 0.5) / _FOLLOWED)
        light = np.stack([(sums <= step[:, None]).sum(axis=1) for step in steps.T], axis=1)
        passed, num_rays = self._passed(np.repeat(position, _FOLLOWED, axis=0), self._directions[light.ravel()])
        return passed.reshape(-1, _FOLLOWED, NUM_CHANNELS).mean(axis=1), num_rays

    def _passed(self, position: F32, directions: F32) -> tuple[F32, int]:
        """Multiply what all sides of tinted glass on the way of rays let pass. Returns (n, 3), how many were traced."""
        geometry, passed = self._geometry, np.ones((len(position), NUM_CHANNELS), np.float32)
        ray, origin, num_rays = np.arange(len(position)), np.array(position, np.float32), 0
        for _ in range(_MAX_SIDES):
            hits = trace_from(geometry.embree, origin, directions[ray], EVERYWHERE)
            num_rays += len(ray)
            goes_on = (hits.face >= 0) & self._is_glass[geometry.face_material[hits.face]]
            ray, face = ray[goes_on], hits.face[goes_on]
            if len(ray) == 0:
                break
            material, normal = geometry.face_material[face], geometry.face_normals[face]
            along = np.einsum("nc,nc->n", normal, directions[ray])
            passed[ray] *= (1 - schlick(np.abs(along), self._f0[material]))[:, None] * self._tint[material]
            origin = places_on(geometry, face, hits.uv[goes_on], np.copysign(np.float32(1), along)[:, None] * normal)
        return passed, num_rays


class Form(NamedTuple):
    """How some samples show light.

    Attributes:
        chance: of their rays, see `relume.points.Points`. (m,) float32
        num: how many share what one sample was. (m,)
        shown: what each shows of the channels, times `num`. (m, 3) float32
    """

    chance: F32
    num: NDArray[np.int64]
    shown: F32


class Split:
    """Samples of which some are several.

    Args:
        tints: of the light that comes to each sample through glass, see `TintedLight.tints`. (n, groups, 3)
        bounds: between groups of samples that stay together, in which neighbors of one kind follow each other; the
            first is 0, the last n.
        by_channel: whether each shows one channel, and no tints.
    """

    def __init__(self, tints: F32, bounds: NDArray[np.integer], *, by_channel: bool) -> None:
        self._tints, self._by_channel = tints, by_channel
        rows, kinds = list[NDArray[np.uint32]](), list[NDArray[np.int8]]()
        for start, stop in pairwise(bounds.tolist()):
            for kind in range(NUM_CHANNELS if by_channel else 1 + tints.shape[1]):
                chosen = np.arange(start, stop, dtype=np.uint32)
                if kind:
                    lit = _is_lit(tints[start:stop])
                    chosen = chosen[np.asarray(lit.any(axis=1)) if by_channel else lit[:, kind - 1]]
                rows.append(chosen)
                kinds.append(np.full(len(chosen), kind, np.int8))
        self.row, self._kind = np.concatenate(rows), np.concatenate(kinds)

    def form(self, rows: slice) -> Form:
        """How some samples that follow each other show light."""
        kind, tints = self._kind[rows].astype(np.int64), self._tints[self.row[rows]]
        lit = _is_lit(tints)
        is_split = np.asarray(lit.any(axis=1))
        if self._by_channel:
            shown = np.where(is_split[:, None], NUM_CHANNELS * np.eye(NUM_CHANNELS, dtype=np.float32)[kind], 1)
            count = np.where(is_split, NUM_CHANNELS, 1)
            return Form(np.where(is_split, OF_CHANNEL[kind], ALIKE), count, shown.astype(np.float32))
        count, shown, beyond = 1 + lit.sum(axis=1), np.zeros((len(kind), NUM_CHANNELS)), np.zeros((len(kind), 1))
        for group in range(tints.shape[1], 0, -1):
            own = np.where(lit[:, group - 1, None], tints[:, group - 1], beyond)
            shown, beyond = np.where(kind[:, None] == group, own - beyond, shown), own
        shown = np.where(kind[:, None] == 0, 1 - beyond, shown) * count[:, None]
        return Form(np.where(is_split, UP_TO_GROUP[kind], ALIKE), count, shown.astype(np.float32))


def _is_lit(tints: F32) -> NDArray[np.bool_]:
    """Whether light comes to samples through each group. (n, groups)"""
    return np.asarray(~np.isnan(tints[..., 0]))


class SplitColumn:
    """A column of samples of which some were split, read as `relume.eye.sorted_rows.Column` is.

    Args:
        name: of the column; shares of a pixel, what glass lets through, and chances change. whole: before.
        split: how.
    """

    def __init__(self, name: str, whole: Column, split: Split) -> None:
        self._name, self._whole, self._split = name, whole, split
        self.dtype, self.shape = whole.dtype, (len(split.row), *whole.shape[1:])

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        """Some rows that follow each other."""
        whole = self._whole.take(self._split.row[rows])
        if self._name not in ("weight", "through", "chance"):
            return whole
        form = self._split.form(rows)
        if self._name == "chance":
            return form.chance
        return np.asarray(whole / form.num if self._name == "weight" else whole * form.shown, self.dtype)

    def __array__(self, dtype: Any = None) -> NDArray[Any]:
        return np.asarray(self[:], dtype)
