"""Quantization of roughness maps, and of the variation of normals within pixels, into levels.

A minified normal map makes a material rougher: normals vary within the footprint of a pixel. With their mean n̄, slopes
have the variance σ² = (1 − |n̄|) / |n̄| along each axis (Toksvig 2005). A level is a ratio of the roughness map together
with a variance; the distribution of facets is convolved with that of the normals (`relume.brdf.roughness_levels`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene.model import Material, Texture
from relume.scene.texture_encoding import decode, decode_rows

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_LEVELS = 24
# Levels are uniform in the square root of the roughness: with uniform roughness, steps would be visible at low
# values, and with uniform log roughness at high ones.
_STEP = 0.02
_MAX_BOTH = 12, 8  # ratios and variances of a material with both
_OUTLIER_FRACTION = 1e-3  # fraction of texels at each end of the range to ignore
_BLOCKS = (8, 64)  # side lengths of texel blocks whose normals are averaged
_MIN_LENGTH = 0.2  # clamp of mean normals; corresponds to more than any roughness


class LevelGrid(NamedTuple):
    """Levels of a material: all pairs of a few ratios and a few slope variances, both ascending.

    Attributes:
        ratios: roughness relative to the material's. slope_variances: of normals within a pixel; the first is zero.
    """

    ratios: tuple[float, ...]
    slope_variances: tuple[float, ...]

    @property
    def pairs(self) -> tuple[tuple[float, float], ...]:
        """Ratio and variance of each level; none if there is only one."""
        pairs = tuple((ratio, variance) for variance in self.slope_variances for ratio in self.ratios)
        return pairs if len(pairs) > 1 else ()

    def select(
        self, ratio: Shaped[F32, " n"], variance: Shaped[F32, " n"], threshold: Shaped[F32, " n"] | float = 0.5
    ) -> Shaped[NDArray[np.uint8], " n"]:
        """Choose a level for each ratio and slope variance. threshold: see `select_level`."""
        # the thresholds of both are independent: other digits of the same number
        second = select_level(self.slope_variances, variance, np.mod(_NEXT_DIGIT * np.asarray(threshold), 1))
        return np.asarray(second * np.uint8(len(self.ratios)) + select_level(self.ratios, ratio, threshold), np.uint8)


_NEXT_DIGIT = 7
ONE_LEVEL = LevelGrid((1.0,), (0.0,))
"""Of a material without a roughness map."""


def levels_of_material(material: Material) -> LevelGrid:
    """Roughness levels relative to the material's terms."""
    texture, base = material.textures.get("roughness"), base_roughness(material)
    return levels_of_texture(texture, base, 1.0 if base is None else min_mean_normal_length(material.normal_map))


def levels_of_texture(texture: Texture | None, base: float | None, min_length: float) -> LevelGrid:
    """Roughness levels over the range of a map, as `levels_of_material` returns them.

    Args:
        texture: roughness over its mean, as bytes; None for a constant 1.
        base: mean roughness; None without an effect of normals.
        min_length: from `min_mean_normal_length`.
    """
    return levels_in_range(*ratio_range(texture), base, min_length)


def ratio_range(texture: Texture | None) -> tuple[float, float]:
    """Range of the ratios in a roughness map, without outliers; (1, 1) for None."""
    if texture is None:
        return 1.0, 1.0
    roots, count = _histogram(texture)
    cumulative = np.cumsum(count) / count.sum()
    low, high = (
        roots[np.searchsorted(cumulative, _OUTLIER_FRACTION)],
        roots[np.searchsorted(cumulative, 1 - _OUTLIER_FRACTION)],
    )
    return float(low**2), float(high**2)


def levels_in_range(lowest: float, highest: float, base: float | None, min_length: float) -> LevelGrid:
    """Roughness levels between the ratios `lowest` and `highest`, with the variances that normals have.

    base, min_length: see `levels_of_texture`.
    """
    most = 0.0 if base is None else float(slope_variance(np.array([min_length], np.float32))[0])
    widest = 1.0 if base is None else (1 + 2 * most / base**4) ** 0.25
    limits = _MAX_BOTH if _num_steps(lowest, highest) > 2 and _num_steps(1, widest) > 2 else (MAX_LEVELS, MAX_LEVELS)
    ratios, widths = _between(lowest, highest, limits[0]), _between(1, widest, limits[1])
    variances = [0.0 if base is None else round((width**4 - 1) * base**4 / 2, 9) for width in widths]
    return LevelGrid(ratios, tuple(variances))


def level_range(grid: LevelGrid, num_ratios: int, num_variances: int) -> LevelGrid:
    """Return other numbers of levels over the range of a grid; one stays one.

    Args:
        grid: any. num_ratios, num_variances: the numbers.
    """
    ratios, variances = (np.sqrt(np.array(axis)) for axis in grid)
    numbers = (num if len(axis) > 1 else 1 for axis, num in zip(grid, (num_ratios, num_variances), strict=True))
    axes = (np.linspace(axis[0], axis[-1], num) for axis, num in zip((ratios, variances), numbers, strict=True))
    return LevelGrid(*(tuple(np.square(axis).tolist()) for axis in axes))


def _num_steps(low: float, high: float) -> int:
    """Number of levels between two ratios."""
    return 1 + int(np.ceil((np.sqrt(high) - np.sqrt(low)) / _STEP))


def _between(low: float, high: float, most: int) -> tuple[float, ...]:
    """Ratios between two; 1 if a level would be enough."""
    num = min(most, _num_steps(low, high))
    return (1.0,) if num < 3 else tuple(np.round(np.square(np.linspace(np.sqrt(low), np.sqrt(high), num)), 6).tolist())


def base_roughness(material: Material) -> float | None:
    """Roughness r of the terms that a material's normal map widens; None without a roughness or normal map."""
    if material.normal_map is None:
        return None
    mapped_terms = (term for term in material.terms if term.get("roughness_map"))
    roughness_values = (term.get("params", {}).get("roughness") for term in mapped_terms)
    return next((float(np.mean(value)) for value in roughness_values if value is not None), None)


def slope_variance(length: Shaped[F32, " n"]) -> Shaped[F32, " n"]:
    """Slope variance σ² along each axis of normals whose mean has a length, at most 1."""
    clamped = np.clip(length, _MIN_LENGTH, 1)
    return np.asarray((1 - clamped) / clamped, np.float32)


def select_level(
    ratios: tuple[float, ...], ratio: Shaped[F32, " n"], threshold: Shaped[F32, " n"] | float = 0.5
) -> Shaped[NDArray[np.uint8], " n"]:
    """Choose one of the two levels that enclose each ratio.

    Args:
        ratios: ratios of the levels, or variances, ascending. ratio: to quantize.
        threshold: smallest fractional position for the higher level, in (0, 1). Thresholds that vary between neighbors
            dither the levels, so that no contours are visible.
    """
    roots, root = np.sqrt(ratios), np.sqrt(ratio)
    level = np.interp(root, roots, np.arange(len(roots)))
    return np.asarray(np.minimum(level + 1 - threshold, len(ratios) - 1), np.uint8)


def min_mean_normal_length(normals: Texture | None) -> float:
    """Approximate length of the shortest mean normal in a pixel's footprint: blocks of two sizes, no outliers.

    Args:
        normals: a normal map; 1 without one.
    """
    lengths = [1.0]
    for rows in () if normals is None else decode_rows(normals):
        for side in _BLOCKS:
            height, width = (max(1, size // side) for size in rows.shape[:2])
            cropped = rows[: height * side, : width * side]
            tall, wide = len(cropped) // height, cropped.shape[1] // width
            means = cropped[: height * tall, : width * wide].reshape(height, tall, width, wide, 3).mean(axis=(1, 3))
            lengths.append(np.quantile(np.linalg.norm(means, axis=-1), _OUTLIER_FRACTION))
    return float(np.min(lengths))


def _histogram(texture: Texture) -> tuple[F64, F64]:
    """Root of the ratio for each byte, ascending, and its number of texels. (256,) each"""
    values = decode(np.arange(256, dtype=np.uint8)[:, None], texture.encoding)[:, 0]
    return np.sqrt(values, dtype=np.float64), np.bincount(texture.pixels.ravel(), minlength=256).astype(np.float64)
