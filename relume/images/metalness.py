"""Metalness images: conversion of a material's terms, as imports convert metallic maps.

Metal has no diffuse reflection, and its highlight has the base color (`relume.scene_io.surfaces.blend`). The image is
therefore not used as a texture: two textures are computed from it and the base color, and put into the same store
(docs/adr/0007-texture-slots-and-images.md). The blue channel is the metalness, as in glTF: linear, without the sRGB
curve.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from relume.images.base_color import (
    BaseColor,
    Document,
    ReadMaterial,
    base_color_terms,
    diffuse_fraction,
    find_base_color,
)
from relume.images.image_store import ImageRecipe, get_record, load_texture, store_derived
from relume.scene.model import Texture, TextureEncoding
from relume.scene.texture_encoding import F64
from relume.scene_io.surfaces.blend import MetallicBlend
from relume.scene_io.surfaces.texture_resampling import Raster

_MIN_F0 = 1e-4
_HEAD_BYTES = 1 << 16  # of a derived image without its texels
_MAX_NAME_LENGTH = 60  # of the image's name, in the names of the derived images


def with_metalness(
    folder: Path,
    terms: Sequence[Document],
    image: str,
    scene: str,
    material: str,
    read: ReadMaterial,
    reserve: Callable[[int], object],
) -> list[dict[str, Any]]:
    """Apply a metalness image to a material.

    Args:
        folder: folder of the image store. terms: terms of the material, complete. image: id of the image.
        scene, material: origin of the terms' texture channels. read: reads that material.
        reserve: called with an upper bound of the size of the derived images before they are stored; its errors
            propagate.
    Returns:
        The terms: diffuse terms and highlights have textures that are derived from the image, and f0 is the mean.
    Raises:
        ParameterError: the material has no diffuse term, or no highlight with f0.
        NotFoundError, SceneError: an image or the scene is unavailable, or the store is full.
    """
    diffuse_indices, specular_indices = base_color_terms(terms)
    base = find_base_color(terms[diffuse_indices[0]], terms[specular_indices[0]], scene, material, read)
    record = get_record(folder, image)
    blend = _blend(base, load_texture(record.texture))
    height, width = blend.raster.size
    reserve(2 * (3 * height * width + _HEAD_BYTES))
    _, highest, mean, _ = blend.f0_and_f90()
    mean = np.maximum(mean, _MIN_F0)

    def store_texture(channel: str, suffix: str, compute: Callable[[], Texture]) -> str:
        recipe = ImageRecipe(channel, record.texture, *_recipe_fields(base))
        return store_derived(folder, f"{record.name[:_MAX_NAME_LENGTH]}, {suffix}", recipe, compute).texture

    new_terms = [dict(term) for term in terms]
    diffuse = store_texture("diffuse", "diffuse", lambda: _scale_texture(blend.diffuse(), base.scale))
    for index in diffuse_indices:
        new_terms[index]["texture"] = diffuse
    # metal had less diffuse reflection
    new_terms[diffuse_indices[0]]["color"] = _triple(base.factor * diffuse_fraction(base.dielectric))
    specular = store_texture("specular", "specular", lambda: blend.normalized_f0(mean, highest))
    for index in specular_indices:
        new_terms[index]["texture"] = specular
    specular_term = new_terms[specular_indices[0]]
    specular_term["params"] = {**specular_term["params"], "f0": _triple(np.clip(mean, 0, 1))}
    return new_terms


def _blend(base: BaseColor, metalness: Texture) -> MetallicBlend:
    pixels = metalness.pixels
    if metalness.encoding is None:
        pixels = np.rint(255 * pixels.astype(np.float32)).astype(np.uint8)
    opaque = np.full((*pixels.shape[:2], 1), 255, np.uint8)
    metalness_image = np.concatenate([pixels, opaque], axis=-1), metalness.wrap
    images = {"packed": metalness_image} if base.pixels is None else {"base": base.pixels, "packed": metalness_image}
    height, width = (max(image.shape[k] for image, _ in images.values()) for k in (0, 1))
    return MetallicBlend(
        Raster(images, (height, width)), np.clip(base.factor * base.scale, 0, 1), base.dielectric, 1.0, 1.0
    )


def _scale_texture(texture: Texture, scale: F64) -> Texture:
    assert texture.encoding is not None
    red, green, blue = (scale * texture.encoding.scale).tolist()
    return replace(texture, encoding=TextureEncoding("srgb", (red, green, blue)))


def _recipe_fields(base: BaseColor) -> tuple[Any, ...]:
    return base.source, base.scene, base.material, tuple(_triple(base.factor)), tuple(_triple(base.dielectric))


def _triple(values: F64) -> list[float]:
    return [round(float(value), 6) for value in values]
