"""Maps of roughness: at how many levels of it a material is shown, and which one each of its samples has."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.scene.coding import decode
from relume.scene.model import Material, Texture

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_LEVELS = 24
# Levels are even in the root of the roughness: evenly rough ones would be told apart where they are smooth, and even
# ratios where they are rough.
_STEP = 0.02
_STRAYS = 1e-3  # share of texels at each end that no level is made for


def levels_of(material: Material) -> tuple[float, ...]:
    """The levels of a material: roughness over what its terms say, rising. None where it has no map, or a plain one."""
    texture = material.textures.get("roughness")
    if texture is None:
        return ()
    roots, count = _histogram(texture)
    share = np.cumsum(count) / count.sum()
    low, high = roots[np.searchsorted(share, _STRAYS)], roots[np.searchsorted(share, 1 - _STRAYS)]
    num = 1 + min(MAX_LEVELS - 1, int(np.ceil((high - low) / _STEP)))
    if num < 3:
        return ()
    return tuple(np.round(np.square(np.linspace(low, high, num)), 6).tolist())


def level_of(ratios: tuple[float, ...], ratio: F32, threshold: F32 | float = 0.5) -> NDArray[np.uint8]:
    """Choose one of the two levels between which each ratio lies.

    Args:
        ratios: of the levels, rising. ratio: (n,)
        threshold: how far it must be from the lower to the higher one to have that. Where neighbours differ in it, they
            have both, in the right shares: no contours are seen. Within (0, 1). (n,)
    Returns:
        (n,)
    """
    roots, given = np.sqrt(ratios), np.sqrt(ratio)
    place = np.interp(given, roots, np.arange(len(roots)))
    return np.asarray(place + 1 - threshold, np.uint8)


def _histogram(texture: Texture) -> tuple[F64, F64]:
    """The root of the ratio that each byte stands for, rising, and how many texels have it. (256,) each"""
    values = decode(np.arange(256, dtype=np.uint8)[:, None], texture.coding)[:, 0]
    return np.sqrt(values, dtype=np.float64), np.bincount(texture.pixels.ravel(), minlength=256).astype(np.float64)
