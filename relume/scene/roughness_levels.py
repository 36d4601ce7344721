"""Maps of roughness: at how many levels of it a material is shown, and which one each of its samples has.

A normal map that is seen from far makes its material rougher: the facets of what a pixel covers lean as its normals do.
With n̄ their mean, slopes have the variance σ² = (1 − |n̄|) / |n̄| along each axis (Toksvig 2005), and a lobe of facets
whose slopes have the variance α² / 2 becomes one of α² + 2 σ² (Olano and Baker 2010). So, α = r²,

    r'(x) = (r(x)⁴ + 2 σ²(x))^¼,   over the r that the material's own terms say,

which is exact while a look leaves that r as it is, and grows with it where it does not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.scene.model import Material, Texture
from relume.scene.texture_encoding import decode, decode_rows

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_LEVELS = 24
# Levels are even in the root of the roughness: evenly rough ones would be told apart where they are smooth, and even
# ratios where they are rough.
_STEP = 0.02
_OUTLIER_FRACTION = 1e-3  # share of texels at each end that no level is made for
_BLOCKS = (8, 64)  # texels across, whose normals are taken together
_MIN_LENGTH = 0.2  # of a mean of normals: rougher than anything is


def levels_of_material(material: Material) -> tuple[float, ...]:
    """The levels of a material: roughness over what its terms say, rising. None where it has no map, or a plain one."""
    texture, base = material.textures.get("roughness"), base_roughness(material)
    return levels_of_texture(texture, base, 1.0 if base is None else min_mean_normal_length(material.normal_map))


def levels_of_texture(texture: Texture | None, base: float | None, min_length: float) -> tuple[float, ...]:
    """The levels between the ends of a map, as `levels_of_material` has them.

    Args:
        texture: roughness over its mean, of bytes; None: one everywhere. base: that mean, see `rougher`; None: bumps
            widen nothing. min_length: from `min_mean_normal_length`.
    """
    return levels_in_range(*ratio_range(texture), base, min_length)


def ratio_range(texture: Texture | None) -> tuple[float, float]:
    """The ratios between which a map of roughness lies, but for strays. texture: it; None: one everywhere."""
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
    """The levels between two ratios, `lowest` and `highest`, where bumps widen what they stand for.

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
    """The roughness r of the terms that a material's normal map widens; None where none follows a map, or there is no
    normal map."""
    if material.normal_map is None:
        return None
    mapped_terms = (term for term in material.terms if term.get("roughness_map"))
    roughness_values = (term.get("params", {}).get("roughness") for term in mapped_terms)
    return next((float(np.mean(value)) for value in roughness_values if value is not None), None)


def rougher(ratio: F32, length: F32, base: float) -> F32:
    """Roughness over `base`, of what covers normals that differ.

    Args:
        ratio: of a map of roughness. (n,) length: of the mean of the normals, at most 1. (n,)
        base: the roughness of the material's terms.
    Returns:
        (n,) float32
    """
    return np.asarray(((base * ratio) ** 4 + 2 * _variance(length)) ** 0.25 / base, np.float32)


def smoother(ratio: F32, length: F32, base: float) -> F32:
    """Roughness over `base` without the bumps that widened it: `rougher` the other way.

    ratio, length, own: as there. Returns (n,) float32
    """
    return np.asarray(np.maximum((base * ratio) ** 4 - 2 * _variance(length), 0) ** 0.25 / base, np.float32)


def _variance(length: F32) -> F32:
    """Of the slopes of normals whose mean is so long, σ². (n,)"""
    clamped = np.clip(length, _MIN_LENGTH, 1)
    return np.asarray((1 - clamped) / clamped, np.float32)


def select_level(ratios: tuple[float, ...], ratio: F32, threshold: F32 | float = 0.5) -> NDArray[np.uint8]:
    """Choose one of the two levels between which each ratio lies.

    Args:
        ratios: of the levels, rising. ratio: (n,)
        threshold: how far it must be from the lower to the higher one to have that. Where neighbours differ in it, they
            have both, in the right shares: no contours are seen. Within (0, 1). (n,)
    Returns:
        (n,)
    """
    roots, root = np.sqrt(ratios), np.sqrt(ratio)
    level = np.interp(root, roots, np.arange(len(roots)))
    return np.asarray(level + 1 - threshold, np.uint8)


def min_mean_normal_length(normals: Texture | None) -> float:
    """About the shortest mean of normals that a pixel covers: of blocks of some sizes, but for strays.

    Args:
        normals: a normal map; without one it is 1.
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
    """The root of the ratio that each byte stands for, rising, and how many texels have it. (256,) each"""
    values = decode(np.arange(256, dtype=np.uint8)[:, None], texture.encoding)[:, 0]
    return np.sqrt(values, dtype=np.float64), np.bincount(texture.pixels.ravel(), minlength=256).astype(np.float64)
