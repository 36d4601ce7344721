"""The environment as point lights, one a texel; and stratified choices of them by power."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.light.environment import texel_solid_angles, turned, uv_to_direction
from relume.scene.model import Environment

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Texels:
    """Texels that are not black.

    Attributes:
        direction: unit, world space. (m, 3) float64
        power: radiance times solid angle. (m, 3) float64
        share: running sum of luminance, the last one is 1. (m,) float64
    """

    direction: F64
    power: F64
    share: F64

    @property
    def num_texels(self) -> int:
        """m."""
        return len(self.direction)

    def times(self, gain: tuple[float, float, float]) -> Texels:
        """Every channel multiplied; none of them where nothing is left."""
        if not any(gain):
            return Texels(self.direction[:0], self.power[:0], self.share[:0])
        return replace(self, power=self.power * np.array(gain))

    def chosen(self, num_samples: int, rng: np.random.Generator) -> Texels:
        """About `num_samples` texels drawn by luminance, one a stratum; their power is divided by how often each is
        expected, so that sums over them estimate sums over all without bias."""
        strata = (np.arange(num_samples) + rng.random(num_samples)) / num_samples
        drawn = np.searchsorted(self.share, strata, side="right")
        index, count = np.unique(np.minimum(drawn, self.num_texels - 1), return_counts=True)
        probability = np.diff(self.share, prepend=0.0)[index]
        weight = count / (num_samples * probability)
        return Texels(self.direction[index], self.power[index] * weight[:, None], np.empty(0))


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
    return Texels(turned(uv_to_direction(u, v).reshape(-1, 3)[lit], rotation), power, share / share[-1])
