"""The base layer of a material with textures: diffuse albedo and f0 of every texel, in batches of rows.

    diffuse = b (1 - m) (1 - R),  f0 = mix(s min(c f, 1), b, m),  f90 = mix(s, 1, m)

for base color b, metallic m, specular s with color c and reflectance f, see `make_material`. The mean reflectance R of
the dielectric scales the texture if it varies, else the term.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Shaped

from relume.scene.model import Texture, TextureEncoding
from relume.scene.texture_encoding import F32, F64, ROWS_PER_BATCH, SRGB_TO_LINEAR, U8, encode_rows
from relume.scene_io.surfaces.texture_resampling import Raster
from relume.scene_io.surfaces.to_terms import dielectric_reflectance


@dataclass(frozen=True)
class MetallicBlend:
    """A material's textures and factors.

    Attributes:
        raster: images "base", "packed", "specular", "tint". factor: factor of the base color.
        dielectric: f0 times the specular color. metallic, specular: factors.
    """

    raster: Raster
    factor: Shaped[F64, " 3"]
    dielectric: Shaped[F64, " 3"]
    metallic: float
    specular: float

    @property
    def _metallic_image(self) -> U8:
        """Image that is multiplied by the metallic factor."""
        return self.raster.channel("packed", 2) if self.metallic else np.zeros((1, 1, 1), np.uint8)

    @property
    def reflectance_varies(self) -> bool:
        """True if the reflectance of the dielectric has a texture that varies."""
        return any(
            self.raster.varies(key, k) for key, channels in (("specular", (3,)), ("tint", (0, 1, 2))) for k in channels
        )

    def mean_reflectance(self) -> float:
        """Mean specular reflectance of the dielectric, of uniform textures or none."""
        tint = SRGB_TO_LINEAR[
            np.rint([255 * self.raster.mean("tint", channel) for channel in range(3)]).astype(np.uint8)
        ]
        weight = self.specular * self.raster.mean("specular", 3)
        return dielectric_reflectance(float(np.minimum(tint * self.dielectric, 1).max()) * weight, weight)

    def _transmittance(self, rows: slice) -> F32:
        """1 − R of texels. (rows, width or 1, 1)"""
        weight = np.float32(self.specular) * _unit_values(self.raster.channel("specular", 3), rows)
        f0 = self._dielectric_f0(rows).max(axis=-1, keepdims=True)
        return np.asarray(1 - dielectric_reflectance(f0, weight), np.float32)

    def diffuse(self) -> Texture:
        """Texture that multiplies the diffuse color."""
        base, metallic = self.raster.rgb("base"), self._metallic_image
        if metallic.size == 1 and base.shape[:2] == self.raster.size and not self.reflectance_varies:
            diffuse_scale = 1 - self.metallic * float(metallic[0, 0, 0]) / 255
            return Texture(
                np.ascontiguousarray(base),
                self.raster.wrap,
                TextureEncoding("srgb", (diffuse_scale, diffuse_scale, diffuse_scale)),
            )

        def values(rows: slice) -> F32:
            diffuse = SRGB_TO_LINEAR[select_rows(base, rows)] * (
                1 - np.float32(self.metallic) * _unit_values(metallic, rows)
            )
            return np.asarray(diffuse * self._transmittance(rows) if self.reflectance_varies else diffuse, np.float32)

        return encode_rows(values, self.raster.size, np.ones(3), self.raster.wrap)

    def _dielectric_f0(self, rows: slice) -> F32:
        weight = np.float32(self.specular) * _unit_values(self.raster.channel("specular", 3), rows)
        tint = SRGB_TO_LINEAR[select_rows(self.raster.rgb("tint"), rows)]
        return np.asarray(np.minimum(tint * self.dielectric.astype(np.float32), 1) * weight, np.float32)

    def _f0(self, rows: slice) -> F32:
        metallic = np.float32(self.metallic) * _unit_values(self._metallic_image, rows)
        head_on = self._dielectric_f0(rows)
        base = (
            SRGB_TO_LINEAR[select_rows(self.raster.rgb("base"), rows)]
            if metallic.any()
            else np.ones((1, 1, 3), np.float32)
        )
        return np.asarray(lerp(head_on, self.factor.astype(np.float32) * base, metallic), np.float32)

    def f0_and_f90(self) -> tuple[Shaped[F64, " 3"], Shaped[F64, " 3"], Shaped[F64, " 3"], float]:
        """Minimum, maximum and mean f0, and the mean reflectance at grazing incidence."""
        height, _ = self.raster.size
        lowest, highest, total = np.full(3, np.inf), np.full(3, -np.inf), np.zeros(3)
        at_horizon = 0.0
        for start in range(0, height, ROWS_PER_BATCH):
            rows = slice(start, min(start + ROWS_PER_BATCH, height))
            row_fraction, f0 = (rows.stop - rows.start) / height, self._f0(rows).reshape(-1, 3)
            lowest, highest = np.minimum(lowest, f0.min(axis=0)), np.maximum(highest, f0.max(axis=0))
            total += row_fraction * f0.mean(axis=0, dtype=np.float64)
            metallic = self.metallic * _unit_values(self._metallic_image, rows)
            weight = self.specular * _unit_values(self.raster.channel("specular", 3), rows)
            at_horizon += row_fraction * float(np.mean(lerp(weight, 1, metallic), dtype=np.float64))
        return lowest, highest, total, at_horizon

    def normalized_f0(self, mean: Shaped[F64, " 3"], highest: Shaped[F64, " 3"]) -> Texture:
        """Texture of f0 over its mean, which multiplies the highlight."""
        base, metallic = self.raster.rgb("base"), self._metallic_image
        if (
            metallic.size == 1
            and self.metallic * float(metallic[0, 0, 0]) == 255
            and base.shape[:2] == self.raster.size
        ):
            red, green, blue = (self.factor / mean).tolist()
            return Texture(np.ascontiguousarray(base), self.raster.wrap, TextureEncoding("srgb", (red, green, blue)))
        divisor = mean.astype(np.float32)
        return encode_rows(lambda rows: self._f0(rows) / divisor, self.raster.size, highest / mean, self.raster.wrap)


def lerp(a: Any, b: Any, weight: Any) -> Any:
    """Interpolate linearly from a, at weight 0, to b, at weight 1."""
    return a + (b - a) * weight


def select_rows(values: U8, rows: slice) -> U8:
    """Select rows of an image, or the single texel of a uniform one. (rows or 1, width or 1, channels)"""
    return values if values.shape[:2] == (1, 1) else values[rows]


def _unit_values(values: U8, rows: slice) -> F32:
    return select_rows(values, rows).astype(np.float32) / np.float32(255)
