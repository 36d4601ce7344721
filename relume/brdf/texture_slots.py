"""What multiplies a term's colour: an image of its material by channel, or one that its look names in that place.

Terms of one channel share what multiplies them: finished pictures are summed by channel before textures are looked up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeGuard, cast

from relume.assets.asset_store import AssetStore
from relume.brdf.registry import TERMS
from relume.core.errors import SceneError
from relume.core.validation import Pointer, invalid_value

TEXTURES = ("diffuse", "specular")
ROUGHNESS = "roughness"
"""What a term's `roughness_map` is called where it is the material's own."""

Images = tuple[str | None, str | None]
"""What a look names in the place of each of a material's `TEXTURES`; None where it names nothing."""


class NormalMap(NamedTuple):
    """An image in the place of a material's normal map.

    Attributes:
        image: "image:<id>", one that was sent. scale: times the x and y of its normals, as glTF has it.
    """

    image: str
    scale: float = 1.0


IMAGES = AssetStore("image", "image:", "image.json", SceneError, max_entries=1_000)
"""Where such images are kept, by `relume.images.image_store`."""


def is_user_image(texture: str | None) -> TypeGuard[str]:
    """Whether a term's `texture` or `roughness_map` names an image rather than one of the material's own."""
    return isinstance(texture, str) and texture.startswith(IMAGES.prefix)


def texture_channel(document: Mapping[str, Any]) -> str | None:
    """The channel of a term's texture: that which it names, or that which its model takes where it names an image.

    Args:
        document: a term, with its `model` and `texture`.
    """
    texture = document.get("texture")
    return TERMS[document["model"]].texture if is_user_image(texture) else texture


def texture_slot(document: Mapping[str, Any]) -> int:
    """Number of the sum that a term is part of: 0 without a texture, 1 + place in `TEXTURES` with one. document: it"""
    channel = texture_channel(document)
    return 0 if channel is None else 1 + TEXTURES.index(channel)


def user_images(documents: Sequence[Mapping[str, Any]]) -> Images:
    """What the terms of a material name in the place of each of `TEXTURES`. documents: its terms"""
    images_by_slot: dict[int, str] = {
        texture_slot(document): document["texture"] for document in documents if is_user_image(document.get("texture"))
    }
    return images_by_slot.get(1), images_by_slot.get(2)


def roughness_image(documents: Sequence[Mapping[str, Any]]) -> str | None:
    """What the terms of a material name in the place of its map of roughness; None where they name nothing.

    Args:
        documents: its terms.
    """
    return next((name for document in documents if is_user_image(name := document.get("roughness_map"))), None)


def check_map(pointer: Pointer, roughness_map: Any) -> str | None:
    """A term's `roughness_map`. Raises ParameterError unless it is null, the material's own, or an image that is here.

    Args:
        pointer: where it stands in its look. roughness_map: what stands there.
    """
    if roughness_map is None or (
        isinstance(roughness_map, str) and (roughness_map == ROUGHNESS or IMAGES.exists(roughness_map))
    ):
        return roughness_map
    raise invalid_value(
        pointer, roughness_map, f"null, {ROUGHNESS!r}, or an image that was sent to /api/images and is here"
    )


def check_image(pointer: Pointer, image: Any) -> str:
    """An image that a look names. Raises ParameterError unless it is here.

    Args:
        pointer: where it stands in its look. image: what stands there.
    """
    if isinstance(image, str) and IMAGES.exists(image):
        return image
    raise invalid_value(pointer, image, "an image that was sent to /api/images and is here")


def check_texture(pointer: Pointer, texture: Any) -> str | None:
    """A term's `texture`. Raises ParameterError unless it is a channel, an image that is here, or nothing.

    Args:
        pointer: where it stands in its look. texture: what stands there.
    """
    if texture is None or texture in TEXTURES or (isinstance(texture, str) and IMAGES.exists(texture)):
        return cast(str | None, texture)
    channels = " or ".join(map(repr, TEXTURES))
    raise invalid_value(pointer, texture, f"null, {channels}, or an image that was sent to /api/images and is here")


def check_shared(pointer: Pointer, documents: Sequence[Mapping[str, Any]]) -> None:
    """Raises ParameterError where terms of one channel are multiplied by different textures, or follow different maps.

    Args:
        pointer: where the list stands in its look. documents: complete terms of one material.
    """
    _check_single_map(pointer, documents)
    textures: dict[int, str | None] = {}
    for k, document in enumerate(documents):
        texture = document["texture"]
        first = textures.setdefault(texture_slot(document), texture)
        if texture != first:
            channel = texture_channel(document)
            allowed = f"{first!r}, as the other {channel} terms of this material have; change them together"
            raise invalid_value((*pointer, k, "texture"), texture, allowed)


def _check_single_map(pointer: Pointer, documents: Sequence[Mapping[str, Any]]) -> None:
    """Samples of a material have one level of roughness each: its terms follow one map, or none."""
    image = roughness_image(documents)
    for k, document in enumerate(documents):
        roughness_map = document.get("roughness_map")
        if image is not None and roughness_map not in (None, image):
            allowed = f"null, or {image!r}, as other terms of this material have; change them together"
            raise invalid_value((*pointer, k, "roughness_map"), roughness_map, allowed)
