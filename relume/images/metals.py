"""What an image of metalness makes of a material, as imports make it of the map of a file.

Where a texel is metal it scatters nothing, and highlights have its base colour (`relume.scene.gltf.blend`). So the
image is no texture of a term itself: two are made of it and of the base colour, texel by texel, and kept on the same
shelf (docs/adr/0103-images-of-metalness.md). Blue says how much a texel is metal, as in files of glTF: the number
itself, no display value.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from relume.images.base_colour import Base, Document, ReadMaterial, base_of, places, scattered
from relume.images.shelf import MadeOf, get_record, keep_made, texture_of
from relume.scene.coding import F64
from relume.scene.gltf.blend import Blend
from relume.scene.gltf.raster import Raster
from relume.scene.model import Coding, Texture

_LEAST_F0 = 1e-4
_LONGEST = 60  # of an image's name that those made of it begin with


def with_metalness(
    folder: Path, terms: Sequence[Document], image: str, scene: str, material: str, read: ReadMaterial
) -> list[dict[str, Any]]:
    """Let an image say where a material is metal.

    Args:
        folder: of the shelf. terms: of the material, complete. image: id of the image.
        scene, material: whose textures the terms name by channel. read: that material.
    Returns:
        The terms: what scatters light and the highlights have textures that are made of the image, and f0 is the mean.
    Raises:
        ParameterError: the material has nothing that scatters light, or no highlight with f0.
        NotFoundError, SceneError: an image or the scene cannot be had, or the shelf is full.
    """
    scatters, shines = places(terms)
    base = base_of(terms[scatters[0]], terms[shines[0]], scene, material, read)
    record = get_record(folder, image)
    blend = _blend(base, texture_of(record.texture))
    _, highest, mean, _ = blend.f0_and_f90()
    mean = np.maximum(mean, _LEAST_F0)

    def kept(channel: str, called: str, make: Callable[[], Texture]) -> str:
        of = MadeOf(channel, record.texture, *_described(base))
        return keep_made(folder, f"{record.name[:_LONGEST]}, {called}", of, make).texture

    made = [dict(term) for term in terms]
    diffuse = kept("diffuse", "what scatters", lambda: _times(blend.diffuse(), base.scale))
    for place in scatters:
        made[place]["texture"] = diffuse
    made[scatters[0]]["color"] = _triple(base.factor * scattered(base.dielectric))  # what was metal scattered less
    specular = kept("specular", "highlights", lambda: blend.f0_over(mean, highest))
    for place in shines:
        made[place]["texture"] = specular
    shining = made[shines[0]]
    shining["params"] = {**shining["params"], "f0": _triple(np.clip(mean, 0, 1))}
    return made


def _blend(base: Base, metalness: Texture) -> Blend:
    pixels = metalness.pixels
    if metalness.coding is None:
        pixels = np.rint(255 * pixels.astype(np.float32)).astype(np.uint8)
    opaque = np.full((*pixels.shape[:2], 1), 255, np.uint8)
    packed = np.concatenate([pixels, opaque], axis=-1), metalness.wrap
    images = {"packed": packed} if base.pixels is None else {"base": base.pixels, "packed": packed}
    height, width = (max(image.shape[k] for image, _ in images.values()) for k in (0, 1))
    return Blend(Raster(images, (height, width)), np.clip(base.factor * base.scale, 0, 1), base.dielectric, 1.0, 1.0)


def _times(texture: Texture, scale: F64) -> Texture:
    assert texture.coding is not None
    red, green, blue = (scale * texture.coding.scale).tolist()
    return replace(texture, coding=Coding("srgb", (red, green, blue)))


def _described(base: Base) -> tuple[Any, ...]:
    return base.said, base.scene, base.material, tuple(_triple(base.factor)), tuple(_triple(base.dielectric))


def _triple(values: F64) -> list[float]:
    return [round(float(value), 6) for value in values]
