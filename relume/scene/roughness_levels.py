"""Quantization of roughness maps into levels.

A minified normal map makes a material rougher: normals vary within the footprint of a pixel. With their mean n̄, slopes
have the variance σ² = (1 − |n̄|) / |n̄| along each axis (Toksvig 2005), and a microfacet lobe with slope variance α² /
2 widens to α² + 2 σ² (Olano and Baker 2010). With α = r²,

    r'(x) = (r(x)⁴ + 2 σ²(x))^¼,   stored relative to the material's own roughness r.

This is exact for the unedited r and scales in proportion if a look changes r.
"""

from __future__ import annotations

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
_OUTLIER_FRACTION = 1e-3  # fraction of texels at each end of the range to ignore
_BLOCKS = (8, 64)  # side lengths of texel blocks whose normals are averaged
_MIN_LENGTH = 0.2  # clamp of mean normals; corresponds to more than any roughness


def levels_of_material(material: Material) -> tuple[float, ...]:
    """Roughness levels relative to the material's terms, ascending; empty if the roughness is uniform."""
    texture, base = material.textures.get("roughness"), base_roughness(material)
    return levels_of_texture(texture, base, 1.0 if base is None else min_mean_normal_length(material.normal_map))


def levels_of_texture(texture: Texture | None, base: float | None, min_length: float) -> tuple[float, ...]:
    """Roughness levels over the range of a map, as `levels_of_material` returns them.

    Args:
        texture: roughness over its mean, as bytes; None for a constant 1.
        base: mean roughness, see `rougher`; None without widening by normals.
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


def levels_in_range(lowest: float, highest: float, base: float | None, min_length: float) -> tuple[float, ...]:
    """Roughness levels between the ratios `lowest` and `highest`, after widening by normals.

    base, min_length: see `levels_of_texture`.
    """
    if base is not None and min_length < 1:
        highest = float(rougher(np.array([highest], np.float32), np.array([min_length], np.float32), base)[0])
    low, high = np.sqrt(lowest), np.sqrt(highest)
    num_levels = 1 + min(MAX_LEVELS - 1, int(np.ceil((high - low) / _STEP)))
    if num_levels < 3:
        return ()
    return tuple(np.round(np.square(np.linspace(low, high, num_levels)), 6).tolist())


def base_roughness(material: Material) -> float | None:
    """Roughness r of the terms that a material's normal map widens; None without a roughness or normal map."""
    if material.normal_map is None:
        return None
    mapped_terms = (term for term in material.terms if term.get("roughness_map"))
    roughness_values = (term.get("params", {}).get("roughness") for term in mapped_terms)
    return next((float(np.mean(value)) for value in roughness_values if value is not None), None)


def rougher(ratio: Shaped[F32, " n"], length: Shaped[F32, " n"], base: float) -> Shaped[F32, " n"]:
    """Roughness relative to `base`, widened by the variation of normals.

    Args:
        ratio: ratio of a roughness map. length: length of the mean normal, at most 1.
        base: the roughness of the material's terms.
    """
    return np.asarray(((base * ratio) ** 4 + 2 * _variance(length)) ** 0.25 / base, np.float32)


def smoother(ratio: Shaped[F32, " n"], length: Shaped[F32, " n"], base: float) -> Shaped[F32, " n"]:
    """Roughness `ratio` of `base` without the widening by normals of mean `length`: the inverse of `rougher`."""
    return np.asarray(np.maximum((base * ratio) ** 4 - 2 * _variance(length), 0) ** 0.25 / base, np.float32)


def _variance(length: F32) -> F32:
    """Slope variance σ² of normals whose mean has this length. (n,)"""
    clamped = np.clip(length, _MIN_LENGTH, 1)
    return np.asarray((1 - clamped) / clamped, np.float32)


def select_level(
    ratios: tuple[float, ...], ratio: Shaped[F32, " n"], threshold: Shaped[F32, " n"] | float = 0.5
) -> Shaped[NDArray[np.uint8], " n"]:
    """Choose one of the two levels that enclose each ratio.

    Args:
        ratios: ratios of the levels, ascending. ratio: ratio to quantize.
        threshold: smallest fractional position for the higher level, in (0, 1). Thresholds that vary between neighbors
            dither the levels, so that no contours are visible.
    """
    roots, root = np.sqrt(ratios), np.sqrt(ratio)
    level = np.interp(root, roots, np.arange(len(roots)))
    return np.asarray(level + 1 - threshold, np.uint8)


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
