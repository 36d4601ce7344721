"""The base layer where images say it: diffuse albedo and reflectance head-on of every texel, some rows at a time.

    diffuse = b (1 - m),  f0 = mix(s min(c f, 1), b, m),  f90 = mix(s, 1, m)

of base colour b, metallic m, specular s with colour c and reflectance f, as `relume.scene.gltf.materials` says.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from relume.scene.coding import F32, F64, ROWS_AT_ONCE, SRGB_TO_LINEAR, U8, made_of
from relume.scene.gltf.raster import Raster
from relume.scene.model import Coding, Texture


@dataclass(frozen=True)
class Blend:
    """A material's images and factors.

    Attributes:
        raster: images "base", "packed", "specular", "tint". factor: of the base colour. (3,)
        dielectric: reflectance head-on with its colour. (3,) metallic, specular: factors.
    """

    raster: Raster
    factor: F64
    dielectric: F64
    metallic: float
    specular: float

    @property
    def _metals(self) -> U8:
        """What the factor of metallic multiplies."""
        return self.raster.channel("packed", 2) if self.metallic else np.zeros((1, 1, 1), np.uint8)

    def diffuse(self) -> Texture:
        """What multiplies the diffuse colour."""
        base, metallic = self.raster.rgb("base"), self._metals
        if metallic.size == 1 and base.shape[:2] == self.raster.size:
            left = 1 - self.metallic * float(metallic[0, 0, 0]) / 255
            return Texture(np.ascontiguousarray(base), self.raster.wrap, Coding("srgb", (left, left, left)))

        def values(rows: slice) -> F32:
            return SRGB_TO_LINEAR[rows_of(base, rows)] * (1 - np.float32(self.metallic) * _share(metallic, rows))

        return made_of(values, self.raster.size, np.ones(3), self.raster.wrap)

    def _f0(self, rows: slice) -> F32:
        metallic = np.float32(self.metallic) * _share(self._metals, rows)
        weight = np.float32(self.specular) * _share(self.raster.channel("specular", 3), rows)
        tint = SRGB_TO_LINEAR[rows_of(self.raster.rgb("tint"), rows)]
        head_on = np.minimum(tint * self.dielectric.astype(np.float32), 1) * weight
        base = (
            SRGB_TO_LINEAR[rows_of(self.raster.rgb("base"), rows)] if metallic.any() else np.ones((1, 1, 3), np.float32)
        )
        return np.asarray(mix(head_on, self.factor.astype(np.float32) * base, metallic), np.float32)

    def f0_and_f90(self) -> tuple[F64, F64, F64, float]:
        """Least, highest and mean reflectance head-on, (3,) each, and the mean at the horizon."""
        height, _ = self.raster.size
        lowest, highest, total = np.full(3, np.inf), np.full(3, -np.inf), np.zeros(3)
        at_horizon = 0.0
        for start in range(0, height, ROWS_AT_ONCE):
            rows = slice(start, min(start + ROWS_AT_ONCE, height))
            share, f0 = (rows.stop - rows.start) / height, self._f0(rows).reshape(-1, 3)
            lowest, highest = np.minimum(lowest, f0.min(axis=0)), np.maximum(highest, f0.max(axis=0))
            total += share * f0.mean(axis=0, dtype=np.float64)
            metallic = self.metallic * _share(self._metals, rows)
            weight = self.specular * _share(self.raster.channel("specular", 3), rows)
            at_horizon += share * float(np.mean(mix(weight, 1, metallic), dtype=np.float64))
        return lowest, highest, total, at_horizon

    def f0_over(self, mean: F64, highest: F64) -> Texture:
        """Reflectance head-on over its mean: what multiplies the highlight."""
        base, metallic = self.raster.rgb("base"), self._metals
        if (
            metallic.size == 1
            and self.metallic * float(metallic[0, 0, 0]) == 255
            and base.shape[:2] == self.raster.size
        ):
            red, green, blue = (self.factor / mean).tolist()
            return Texture(np.ascontiguousarray(base), self.raster.wrap, Coding("srgb", (red, green, blue)))
        over = mean.astype(np.float32)
        return made_of(lambda rows: self._f0(rows) / over, self.raster.size, highest / mean, self.raster.wrap)


def mix(a: Any, b: Any, share: Any) -> Any:
    """From a, where the share is 0, to b, where it is 1."""
    return a + (b - a) * share


def rows_of(values: U8, rows: slice) -> U8:
    """Rows of an image, or the one texel that stands for all. (rows or 1, width or 1, channels)

    Args:
        values: of the image, or of that texel. rows: of the image.
    """
    return values if values.shape[:2] == (1, 1) else values[rows]


def _share(values: U8, rows: slice) -> F32:
    return rows_of(values, rows).astype(np.float32) / np.float32(255)
