"""Light that comes through tinted glass: a view sample that it reaches is several, one for each tint and one besides.

A sample and a light have one bit, visible or not. Let P_g be the visibility where glass of the first g groups of tints
lets all pass, and tinted glass of the others stops all. Of the light that P_g and not P_g-1 sees, each channel has the
share T_g, the mean of what the sides of glass let pass on the way. So the visibility is

    V = P_0 + sum_g (P_g - P_g-1) T_g  =  P_0 (1 - T_1) + P_1 (T_1 - T_2) + ... + P_G T_G

in each channel, and each P is that of a sample whose share of the pixel is multiplied by what stands beside it. A lobe
that sees one light sees its tint, and nothing that sums light knows of it
(docs/direct-light.md#glass-mirrors-shadow-catchers). Brute force does without means: its samples are of one channel
each, and their rays pass by the tint of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.fresnel import schlick
from relume.camera.external_sort import Column
from relume.core.color import luminance
from relume.core.thread_pools import for_ranges
from relume.lights.spherical_triangles import tessellate_environment
from relume.raytrace.alpha_filter import ONE_CHANNEL, PASS_TINT_GROUPS, STOP_AT_OPAQUE
from relume.raytrace.alpha_test import GLASS_RULE, MAX_TINTS, is_tinted
from relume.raytrace.barycentric import positions_on_faces
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE
from relume.raytrace.visibility_masks import make_light_targets, trace_visibility_masks
from relume.scene.model import Material

F32 = NDArray[np.float32]

NUM_CHANNELS = 3
_NUM_LIGHTS = 200  # for which visibility is traced
_NUM_PATHS = 16  # ways through a group of tints, spread evenly over the light that comes along them
_MAX_SIDES = 16  # of glass on that way
_POINTS_PER_RANGE = 4096
POINTS_PER_BLOCK = 16 * _POINTS_PER_RANGE
_MIN_LIGHT_FRACTION = 0.01  # of the light that is above a sample's horizon; less through tinted glass is gray


def num_tints(materials: Sequence[Material]) -> int:
    """Bound the groups of tints, 0 where no shadow has a color."""
    return min(MAX_TINTS, sum(is_tinted(material.glass) for material in materials if material.glass is not None))


def max_tint_rays(materials: Sequence[Material]) -> int:
    """Bound the rays that are traced for each sample."""
    num = num_tints(materials)
    return (1 + num) * _NUM_LIGHTS + num * _NUM_PATHS * _MAX_SIDES if num else 0


class TintedLight:
    """Light of an environment, or of lights in its place, that comes through tinted glass.

    Args:
        geometry: the triangles, some of them of tinted glass.
        radiance: equirectangular, top row first. (height, width, 3) float32
    """

    def __init__(self, geometry: SceneBuffers, radiance: F32) -> None:
        mean_radiance = float(radiance.mean(dtype=np.float64)) or 1.0  # as lamps and surfaces may be in any direction
        lights = tessellate_environment(radiance + np.float32(mean_radiance), _NUM_LIGHTS)
        self._geometry, self._directions = geometry, lights.direction
        self._targets, self._weight = (
            make_light_targets(lights.direction, lights.irradiance),
            luminance(lights.irradiance),
        )
        alpha_test = geometry.embree.alpha_test
        assert alpha_test is not None
        self.num_groups = int(alpha_test.groups.max(initial=0))
        material_rule = alpha_test.alpha_masks.material_rule
        self._is_glass = (material_rule >= 0) & (alpha_test.alpha_masks.rules[material_rule, 0] == GLASS_RULE)
        # the share of others is in what rays see
        is_tinted_glass = self._is_glass & (alpha_test.groups[material_rule] > 0)
        self._tint = np.where(is_tinted_glass[:, None], alpha_test.alpha_masks.rules[material_rule, 1:4], np.float32(1))
        self._f0 = np.where(is_tinted_glass, alpha_test.alpha_masks.rules[material_rule, 4], np.float32(0))

    def tints(self, position: F32, normal: F32) -> tuple[F32, int]:
        """Find the mean tint of the light that each group lets through to points.

        Args:
            position, normal: of n points, neighbors mostly next to each other. (n, 3) each. What is found for them does
                not change where others are left out by blocks of `POINTS_PER_BLOCK`.
        Returns:
            What glass passes of each channel on the way, of light that comes through this group and through none of a
            higher number; NaN where it is too little. (n, groups, 3). How many rays that took.
        """
        visibility = [
            trace_visibility_masks(
                self._geometry.embree, position, normal, self._targets, PASS_TINT_GROUPS[group : group + 1]
            )
            for group in range(self.num_groups + 1)
        ]
        tints = np.full((len(position), self.num_groups, NUM_CHANNELS), np.nan, np.float32)
        num_rays = [sum(masks.rays.num_traced for masks in visibility)]

        def measure(start: int, stop: int) -> None:
            cosine = normal[start:stop] @ self._directions.T
            min_light = _MIN_LIGHT_FRACTION * ((cosine > 0) @ self._weight)
            for group in range(self.num_groups):
                bits_of_group = visibility[group + 1].visible[start:stop] & ~visibility[group].visible[start:stop]
                bits = np.unpackbits(bits_of_group, axis=1, count=len(self._weight), bitorder="little")
                lit = np.flatnonzero(bits @ self._weight > min_light)
                weight = bits[lit] * np.maximum(cosine[lit], np.float32(1e-6)) * self._weight
                tints[start + lit, group], num_traced = self._mean_tint(position[start + lit], weight)
                num_rays.append(num_traced)

        for_ranges(measure, len(position), _POINTS_PER_RANGE)
        return tints, sum(num_rays)

    def _mean_tint(self, position: F32, weight: F32) -> tuple[F32, int]:
        """Find the mean tint on the ways from points to lights. weight: of each light. (n, lights)"""
        sums = np.cumsum(weight, axis=1, dtype=np.float64)
        steps = sums[:, -1:] * ((np.arange(_NUM_PATHS) + 0.5) / _NUM_PATHS)
        light = np.stack([(sums <= step[:, None]).sum(axis=1) for step in steps.T], axis=1)
        transmittance, num_rays = self._path_transmittance(
            np.repeat(position, _NUM_PATHS, axis=0), self._directions[light.ravel()]
        )
        return transmittance.reshape(-1, _NUM_PATHS, NUM_CHANNELS).mean(axis=1), num_rays

    def _path_transmittance(self, position: F32, directions: F32) -> tuple[F32, int]:
        """Multiply what all sides of tinted glass on the way of rays let pass. Returns (n, 3), how many were traced."""
        geometry, transmittance = self._geometry, np.ones((len(position), NUM_CHANNELS), np.float32)
        ray, origin, num_rays = np.arange(len(position)), np.array(position, np.float32), 0
        for _ in range(_MAX_SIDES):
            hits = trace_rays(geometry.embree, origin, directions[ray], STOP_AT_OPAQUE)
            num_rays += len(ray)
            is_glass_hit = (hits.face >= 0) & self._is_glass[geometry.face_material[hits.face]]
            ray, face = ray[is_glass_hit], hits.face[is_glass_hit]
            if len(ray) == 0:
                break
            material, normal = geometry.face_material[face], geometry.face_normals[face]
            facing = np.einsum("nc,nc->n", normal, directions[ray])
            transmittance[ray] *= (1 - schlick(np.abs(facing), self._f0[material]))[:, None] * self._tint[material]
            origin = positions_on_faces(
                geometry, face, hits.uv[is_glass_hit], np.copysign(np.float32(1), facing)[:, None] * normal
            )
        return transmittance, num_rays


class SplitWeights(NamedTuple):
    """How some samples show light.

    Attributes:
        alpha_sample: of their rays, see `relume.raytrace.surface_points.SurfacePoints`. (m,) float32
        num_parts: how many share what one sample was. (m,)
        channel_weights: what each shows of the channels, times `num_parts`. (m, 3) float32
    """

    alpha_sample: F32
    num_parts: NDArray[np.int64]
    channel_weights: F32


class TintSplit:
    """Samples of which some are several.

    Args:
        tints: of the light that comes to each sample through glass, see `TintedLight.tints`. (n, groups, 3)
        bounds: between groups of samples that stay together, in which neighbors of one kind follow each other; the
            first is 0, the last n.
        by_channel: whether each shows one channel, and no tints.
    """

    def __init__(self, tints: F32, bounds: NDArray[np.integer], *, by_channel: bool) -> None:
        self._tints, self._by_channel = tints, by_channel
        rows, part_indices = list[NDArray[np.uint32]](), list[NDArray[np.int8]]()
        for start, stop in pairwise(bounds.tolist()):
            for part_index in range(NUM_CHANNELS if by_channel else 1 + tints.shape[1]):
                sample_rows = np.arange(start, stop, dtype=np.uint32)
                if part_index:
                    lit = _is_lit(tints[start:stop])
                    sample_rows = sample_rows[np.asarray(lit.any(axis=1)) if by_channel else lit[:, part_index - 1]]
                rows.append(sample_rows)
                part_indices.append(np.full(len(sample_rows), part_index, np.int8))
        self.row, self._kind = np.concatenate(rows), np.concatenate(part_indices)

    def weights(self, rows: slice) -> SplitWeights:
        """How some samples that follow each other show light."""
        part_index, tints = self._kind[rows].astype(np.int64), self._tints[self.row[rows]]
        lit = _is_lit(tints)
        is_split = np.asarray(lit.any(axis=1))
        if self._by_channel:
            channel_weights = np.where(
                is_split[:, None], NUM_CHANNELS * np.eye(NUM_CHANNELS, dtype=np.float32)[part_index], 1
            )
            num_parts = np.where(is_split, NUM_CHANNELS, 1)
            return SplitWeights(
                np.where(is_split, ONE_CHANNEL[part_index], FIXED_ALPHA_SAMPLE),
                num_parts,
                channel_weights.astype(np.float32),
            )
        num_parts, channel_weights, next_tint = (
            1 + lit.sum(axis=1),
            np.zeros((len(part_index), NUM_CHANNELS)),
            np.zeros((len(part_index), 1)),
        )
        for group in range(tints.shape[1], 0, -1):
            tint = np.where(lit[:, group - 1, None], tints[:, group - 1], next_tint)
            channel_weights, next_tint = np.where(part_index[:, None] == group, tint - next_tint, channel_weights), tint
        channel_weights = np.where(part_index[:, None] == 0, 1 - next_tint, channel_weights) * num_parts[:, None]
        return SplitWeights(
            np.where(is_split, PASS_TINT_GROUPS[part_index], FIXED_ALPHA_SAMPLE),
            num_parts,
            channel_weights.astype(np.float32),
        )


def _is_lit(tints: F32) -> NDArray[np.bool_]:
    """Whether light comes to samples through each group. (n, groups)"""
    return np.asarray(~np.isnan(tints[..., 0]))


class SplitColumn:
    """A column of samples of which some were split, read as `relume.camera.external_sort.Column` is.

    Args:
        name: of the column; weight, transmittance and alpha_sample change. whole: before.
        split: how.
    """

    def __init__(self, name: str, whole: Column, split: TintSplit) -> None:
        self._name, self._whole, self._split = name, whole, split
        self.dtype, self.shape = whole.dtype, (len(split.row), *whole.shape[1:])

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        """Some rows that follow each other."""
        values = self._whole.take(self._split.row[rows])
        if self._name not in ("weight", "transmittance", "alpha_sample"):
            return values
        weights = self._split.weights(rows)
        if self._name == "alpha_sample":
            return weights.alpha_sample
        return np.asarray(
            values / weights.num_parts if self._name == "weight" else values * weights.channel_weights, self.dtype
        )

    def __array__(self, dtype: Any = None) -> NDArray[Any]:
        return np.asarray(self[:], dtype)
