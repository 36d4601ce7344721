"""The environment as point lights, one a texel; and directions drawn by power within stratified choices of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.environments.equirect import direction_to_uv, texel_solid_angles, turned, uv_to_direction
from relume.environments.model import Environment

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Texels:
    """Texels that are not black.

    Attributes:
        direction: unit, world space. (m, 3) float64
        power: radiance times solid angle. (m, 3) float64
        share: running sum of luminance, the last one is 1. (m,) float64
        index: of each in the map, row-major. (m,)
        map: the environment's radiance. (height, width, 3) float32
        rotation: of the map about +Y, degrees. gain: what multiplies its channels.
        luminance: of all of them, times solid angle, before the gain.
    """

    direction: F64
    power: F64
    share: F64
    index: NDArray[np.intp]
    map: F32
    rotation: float
    gain: tuple[float, float, float]
    luminance: float

    @property
    def num_texels(self) -> int:
        """m."""
        return len(self.direction)

    def times(self, gain: tuple[float, float, float]) -> Texels:
        """Every channel multiplied; none of them where nothing is left."""
        if not any(gain):
            return replace(self, direction=self.direction[:0], power=self.power[:0], share=self.share[:0])
        return replace(self, power=self.power * np.array(gain), gain=gain)

    def drawn(self, num_samples: int, rng: np.random.Generator) -> F64:
        """Directions anywhere in texels drawn by luminance, one a stratum, with the density `density`. (num, 3)"""
        strata = (np.arange(num_samples) + rng.random(num_samples)) / num_samples
        drawn = np.minimum(np.searchsorted(self.share, strata, side="right"), self.num_texels - 1)
        height, width, _ = self.map.shape
        row, column = np.divmod(self.index[drawn], width)
        u = (column + rng.random(num_samples)) / width
        upper, lower = (np.sin(np.pi * (0.5 - edge / height)) for edge in (row, row + 1))
        v = 0.5 - np.arcsin(upper + rng.random(num_samples) * (lower - upper)) / np.pi
        return turned(uv_to_direction(u, v), self.rotation)

    def radiance(self, direction: F64) -> tuple[F64, F64]:
        """What comes from unit directions (..., 3), texels having one value each, and the density with which `drawn`
        draws them, per steradian. (..., 3), (...)"""
        height, width, _ = self.map.shape
        u, v = direction_to_uv(turned(direction.reshape(-1, 3), -self.rotation))
        column = np.minimum((u * width).astype(np.intp), width - 1)
        row = np.minimum((v * height).astype(np.intp), height - 1)
        found = self.map[row, column].reshape(direction.shape)
        density = luminance(found).astype(np.float64) / self.luminance
        return found.astype(np.float64) * np.array(self.gain), density


def texels_of(environment: Environment, rotation: float = 0.0) -> Texels:
    """All texels with light in them.

    Args:
        rotation: of the map about +Y, degrees.
    """
    height, width, _ = environment.radiance.shape
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    power = environment.radiance.astype(np.float64) * texel_solid_angles(height, width)[:, None, None]
    lit = power.reshape(-1, 3).any(axis=1)
    power = power.reshape(-1, 3)[lit]
    share = np.cumsum(luminance(power.astype(np.float32)).astype(np.float64))
    direction = turned(uv_to_direction(u, v).reshape(-1, 3)[lit], rotation)
    index, total = np.nonzero(lit)[0], float(share[-1])
    return Texels(direction, power, share / total, index, environment.radiance, rotation, (1.0, 1.0, 1.0), total)
