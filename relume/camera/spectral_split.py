"""Split view samples that tinted glass lights: one sample per group of tints, and one for untinted light.

A sample and a light have one visibility bit. Let P_g be the visibility if glass of the first g groups of tints passes
all light, and other tinted glass blocks it. Light in P_g but not in P_g-1 has the mean transmittance T_g of the glass
on its path, per channel. So the visibility is

    V = P_0 + sum_g (P_g - P_g-1) T_g  =  P_0 (1 - T_1) + P_1 (T_1 - T_2) + ... + P_G T_G

in each channel, and each P is the visibility of one sample, whose pixel weight is multiplied by the factor of P. Any
sum over lights stays correct without knowing about tints (docs/direct-light.md#glass-mirrors-shadow-catchers). The
reference needs no means: it splits samples by channel, and their rays use the tint of that channel.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.fresnel import schlick
from relume.camera.external_sort import Column
from relume.core.color import luminance
from relume.core.thread_pools import for_ranges
from relume.lights.spherical_triangles import tessellate_environment
from relume.raytrace.alpha_filter import ONE_CHANNEL, PASS_TINT_GROUPS, STOP_AT_OPAQUE
from relume.raytrace.alpha_test import MAX_TINTS, is_tinted
from relume.raytrace.barycentric import positions_on_faces
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE
from relume.raytrace.visibility_masks import make_light_targets, trace_visibility_masks
from relume.scene.model import Material

F32 = NDArray[np.float32]

NUM_CHANNELS = 3
_NUM_LIGHTS = 200  # lights for which visibility is traced
_NUM_PATHS = 16  # paths through a group of tints, distributed by irradiance
_MAX_SIDES = 16  # glass surfaces on a path
_POINTS_PER_RANGE = 4096
POINTS_PER_BLOCK = 16 * _POINTS_PER_RANGE
_MIN_LIGHT_FRACTION = 0.01  # of the light above a sample's horizon; less tinted light than this is treated as gray


def num_tints(materials: Sequence[Material]) -> int:
    """Upper bound of the number of tint groups; 0 if no shadow is tinted."""
    return min(MAX_TINTS, sum(is_tinted(material.glass) for material in materials if material.glass is not None))


def max_tint_rays(materials: Sequence[Material]) -> int:
    """Upper bound of the number of rays traced per sample."""
    num = num_tints(materials)
    return (1 + num) * _NUM_LIGHTS + num * _NUM_PATHS * _MAX_SIDES if num else 0


class TintedLight:
    """Light that reaches points through tinted glass, from an environment or a replacement for it.

    Args:
        geometry: the triangles, some of them of tinted glass.
        radiance: equirectangular, top row first.
    """

    def __init__(self, geometry: SceneBuffers, radiance: Shaped[F32, "h w 3"]) -> None:
        mean_radiance = float(radiance.mean(dtype=np.float64)) or 1.0  # area lights may be in any direction
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
        self._is_glass = alpha_test.alpha_masks.is_glass
        # camera rays already include the transmittance of untinted glass
        is_tinted_glass = self._is_glass & (alpha_test.groups[material_rule] > 0)
        self._tint = np.where(is_tinted_glass[:, None], alpha_test.alpha_masks.rules[material_rule, 1:4], np.float32(1))
        self._f0 = np.where(is_tinted_glass, alpha_test.alpha_masks.rules[material_rule, 4], np.float32(0))

    def tints(self, position: Shaped[F32, "n 3"], normal: Shaped[F32, "n 3"]) -> tuple[Shaped[F32, "n groups 3"], int]:
        """Find the mean tint of the light that reaches points through each group.

        Args:
            position, normal: positions and normals of n points, mostly ordered by neighborhood. Omitting other blocks
                of `POINTS_PER_BLOCK` points does not change the result.
        Returns:
            Mean transmittance of light through this group and no group with a higher number, NaN if there is too
            little light; and the number of traced rays.
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
        """Mean tint on paths from points to lights. weight: weight of each light. (n, lights)"""
        sums = np.cumsum(weight, axis=1, dtype=np.float64)
        steps = sums[:, -1:] * ((np.arange(_NUM_PATHS) + 0.5) / _NUM_PATHS)
        light = np.stack([(sums <= step[:, None]).sum(axis=1) for step in steps.T], axis=1)
        transmittance, num_rays = self._path_transmittance(
            np.repeat(position, _NUM_PATHS, axis=0), self._directions[light.ravel()]
        )
        return transmittance.reshape(-1, _NUM_PATHS, NUM_CHANNELS).mean(axis=1), num_rays

    def _path_transmittance(self, position: F32, directions: F32) -> tuple[F32, int]:
        """Transmittance of all tinted glass on rays (n, 3), and the number of traced rays."""
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
    """Weights of split samples.

    Attributes:
        alpha_sample: alpha samples for their shadow rays, see `relume.raytrace.surface_points.SurfacePoints`.
        num_parts: number of split samples that replace the same sample.
        channel_weights: factor per channel, times `num_parts`.
    """

    alpha_sample: Shaped[F32, " n"]
    num_parts: Shaped[NDArray[np.int64], " n"]
    channel_weights: Shaped[F32, "n 3"]


class TintSplit:
    """Split samples, in order.

    Args:
        tints: tints of the light that reaches each sample through glass, see `TintedLight.tints`. (n, groups, 3)
        bounds: ascending, from 0 to n; the split samples of [bounds[i], bounds[i + 1]) stay together, so that neighbors
            of the same tint group are adjacent.
        by_channel: split by channel instead of by tint.
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
        """Weights of consecutive split samples."""
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
    """True if light reaches a sample through a group. (n, groups)"""
    return np.asarray(~np.isnan(tints[..., 0]))


class SplitColumn:
    """Column of samples after splitting, read like `relume.camera.external_sort.Column`.

    Args:
        name: name of the column; weight, transmittance and alpha_sample change. whole: the column before splitting.
        split: the split samples.
    """

    def __init__(self, name: str, whole: Column, split: TintSplit) -> None:
        self._name, self._whole, self._split = name, whole, split
        self.dtype, self.shape = whole.dtype, (len(split.row), *whole.shape[1:])

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        """Read consecutive rows."""
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
