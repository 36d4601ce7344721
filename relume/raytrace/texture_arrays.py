"""Textures of a scene as arrays of a store."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.raytrace.texture import MipMap
from relume.scene.model import WRAPS, Scene, Texture

F32 = NDArray[np.float32]

MAX_TEXTURE_SIDE = 2048  # finer mip levels are not stored
_MAX_TEXELS = 1 << 25  # of all finest levels together; 12 bytes each
_MAX_VALUE = 6e4  # of half precision
_CHANNELS = ("diffuse", "specular")  # `relume.brdf.texture_slots` loads all terms


def texture_attributes(scene: Scene) -> dict[str, Any]:
    """Return the attributes of a store that describe the textures of a scene's materials.

    They are the texture of each material in each of `relume.brdf.texture_slots.TEXTURES`, its normal map, its emission
    image and its roughness map, −1 for none, and the wrap modes of each texture and of each roughness map.
    """
    index = {
        id(texture): k
        for textures in (_textures_of(scene), _roughness_maps(scene))
        for k, texture in enumerate(textures)
    }

    def index_of(texture: Texture | None) -> int:
        return -1 if texture is None else index[id(texture)]

    return {
        "textures": [[index_of(m.textures.get(name)) for name in _CHANNELS] for m in scene.materials],
        "normal_maps": [index_of(m.normal_map) for m in scene.materials],
        "emission_images": [index_of(m.textures.get("emission")) for m in scene.materials],
        "roughness_maps": [index_of(m.textures.get("roughness")) for m in scene.materials],
        "wraps": _wraps(_textures_of(scene)),
        "roughness_wraps": _wraps(_roughness_maps(scene)),
    }


def _wraps(textures: Sequence[Texture]) -> list[list[int]]:
    return [[WRAPS.index(wrap) for wrap in texture.wrap] for texture in textures]


def texture_arrays(scene: Scene) -> dict[str, NDArray[Any]]:
    """Return the textures of a scene as arrays of a store: each once, at most `MAX_TEXTURE_SIDE` wide and high.

    Returns:
        "textures/<k>", (height, width, 3) float16; "roughness/<k>", (height, width, 1) float16.
    """
    textures, roughness = _textures_of(scene), _roughness_maps(scene)
    side = _max_side([*textures, *roughness])
    paths = [f"textures/{k}" for k in range(len(textures))] + [f"roughness/{k}" for k in range(len(roughness))]
    finest = (np.minimum(_level_pixels(texture, side), _MAX_VALUE) for texture in (*textures, *roughness))
    return {path: pixels.astype(np.float16) for path, pixels in zip(paths, finest, strict=True)}


def _textures_of(scene: Scene) -> list[Texture]:
    """Return the textures of a scene's materials, each once."""
    textures = (
        texture
        for m in scene.materials
        for texture in (*(m.textures.get(name) for name in _CHANNELS), m.normal_map, m.textures.get("emission"))
    )
    return list({id(texture): texture for texture in textures if texture is not None}.values())


def _roughness_maps(scene: Scene) -> list[Texture]:
    """Return the roughness maps of a scene's materials, each once."""
    textures = (m.textures.get("roughness") for m in scene.materials)
    return list({id(texture): texture for texture in textures if texture is not None}.values())


def _max_side(textures: Sequence[Texture]) -> int:
    """Largest texture side for which all textures together have at most `_MAX_TEXELS`."""
    side, pyramids = MAX_TEXTURE_SIDE, [MipMap.for_texture(texture) for texture in textures]
    while side > 1 and sum(p.levels[level_index(p, side)].size // 3 for p in pyramids) > _MAX_TEXELS:
        side //= 2
    return side


def _level_pixels(texture: Texture, side: int) -> F32:
    pyramid = MipMap.for_texture(texture)
    return pyramid.level(level_index(pyramid, side))


def level_index(pyramid: MipMap, side: int) -> int:
    """Return the finest level of a texture that is at most `side` wide and high."""
    return next(k for k, level in enumerate(pyramid.levels) if max(level.shape[:2]) <= side)
