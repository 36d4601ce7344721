"""The environment as one point light per texel, and importance sampling of directions by luminance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.equirect import direction_to_uv, rotate_about_y, texel_solid_angles, uv_to_direction
from relume.core.color import luminance

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True)
class EnvironmentSamples:
    """Environment texels that are not black.

    Attributes:
        direction: unit, world space.
        power: radiance times solid angle.
        cdf: cumulative distribution of luminance, ending in 1.
        index: index of each texel in the map, row-major.
        map: the environment's radiance.
        rotation: rotation of the map about +Y, degrees. gain: factor of each channel.
        luminance: total luminance times solid angle, before the gain.
        lit_meshes: the meshes that the environment lights; None: all.
    """

    direction: Shaped[F64, "m 3"]
    power: Shaped[F64, "m 3"]
    cdf: Shaped[F64, " m"]
    index: Shaped[NDArray[np.intp], " m"]
    map: Shaped[F32, "height width 3"]
    rotation: float
    gain: tuple[float, float, float]
    luminance: float
    lit_meshes: Sequence[bool] | None = None

    @property
    def num_texels(self) -> int:
        """Number of texels m."""
        return len(self.direction)

    def scaled(self, gain: tuple[float, float, float]) -> EnvironmentSamples:
        """Multiply the channels by a gain; no texels remain if it is zero."""
        if not any(gain):
            return replace(
                self, direction=self.direction[:0], power=self.power[:0], cdf=self.cdf[:0], index=self.index[:0]
            )
        return replace(self, power=self.power * np.array(gain), gain=gain)

    def sample_directions(self, num_samples: int, rng: np.random.Generator) -> Shaped[F64, "num 3"]:
        """Sample directions by luminance, stratified and uniform within texels, with the density from `radiance`."""
        strata = (np.arange(num_samples) + rng.random(num_samples)) / num_samples
        texel_index = np.minimum(np.searchsorted(self.cdf, strata, side="right"), self.num_texels - 1)
        height, width, _ = self.map.shape
        row, column = np.divmod(self.index[texel_index], width)
        u = (column + rng.random(num_samples)) / width
        upper, lower = (np.sin(np.pi * (0.5 - edge / height)) for edge in (row, row + 1))
        v = 0.5 - np.arcsin(upper + rng.random(num_samples) * (lower - upper)) / np.pi
        return rotate_about_y(uv_to_direction(u, v), self.rotation)

    def radiance(self, direction: Shaped[F64, "*batch 3"]) -> tuple[Shaped[F64, "*batch 3"], Shaped[F64, "*batch"]]:
        """Radiance from unit directions, without interpolation, and the density of `sample_directions`, 1/sr."""
        height, width, _ = self.map.shape
        u, v = direction_to_uv(rotate_about_y(direction.reshape(-1, 3), -self.rotation))
        column = np.minimum((u * width).astype(np.intp), width - 1)
        row = np.minimum((v * height).astype(np.intp), height - 1)
        texel_radiance = self.map[row, column].reshape(direction.shape)
        pdf = luminance(texel_radiance).astype(np.float64) / self.luminance
        return texel_radiance.astype(np.float64) * np.array(self.gain), pdf


def environment_texels(environment: Environment, rotation: float = 0.0) -> EnvironmentSamples:
    """All texels that are not black.

    Args:
        rotation: rotation of the map about +Y, degrees.
    """
    height, width, _ = environment.radiance.shape
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    power = environment.radiance.astype(np.float64) * texel_solid_angles(height, width)[:, None, None]
    is_lit = power.reshape(-1, 3).any(axis=1)
    power = power.reshape(-1, 3)[is_lit]
    cumulative = np.cumsum(luminance(power.astype(np.float32)).astype(np.float64))
    direction = rotate_about_y(uv_to_direction(u, v).reshape(-1, 3)[is_lit], rotation)
    index, total = np.nonzero(is_lit)[0], float(cumulative[-1])
    return EnvironmentSamples(
        direction, power, cumulative / total, index, environment.radiance, rotation, (1.0, 1.0, 1.0), total
    )
