"""Texture slots: the image that multiplies a term's color, one of the material's textures or an image in the look.

All terms of one channel share a texture, because their images are summed per channel before texture lookups.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeGuard, cast

from relume.assets.asset_store import AssetStore
from relume.brdf.registry import TERMS
from relume.core.errors import SceneError
from relume.core.validation import Pointer, invalid_value
from relume.math.uv_transform import UvTransform

TEXTURES = ("diffuse", "specular")
ROUGHNESS = "roughness"
"""Value of a term's `roughness_map` that means the material's own map."""

Images = tuple[str | None, str | None]
"""Images in a look that replace each of a material's `TEXTURES`; None: not replaced."""


class NormalMap(NamedTuple):
    """An image that replaces a material's normal map.

    Attributes:
        image: "image:<id>" of an uploaded image. scale: factor of the x and y of its normals, as in glTF.
        uv: transform of its texture coordinates; None: as they are.
    """

    image: str
    scale: float = 1.0
    uv: UvTransform | None = None


class EmissionImage(NamedTuple):
    """An image that surfaces emit, or the gobo of a spot, relative to the mean emission.

    Attributes:
        image: "image:<id>" of an uploaded image. mean: its mean over the surfaces or the cone, linear RGB.
        is_colored: its color varies over them.
    """

    image: str
    mean: tuple[float, float, float]
    is_colored: bool


IMAGES = AssetStore("image", "image:", "image.json", SceneError, max_entries=1_000)
"""Store of uploaded images, filled by `relume.images.image_store`."""


def is_user_image(texture: str | None) -> TypeGuard[str]:
    """True if a term's `texture` or `roughness_map` names an uploaded image rather than one of the material's own."""
    return isinstance(texture, str) and texture.startswith(IMAGES.prefix)


def texture_channel(document: Mapping[str, Any]) -> str | None:
    """Channel of a term's texture: the named channel, or the channel of its model if it names an image.

    Args:
        document: a term, with its `model` and `texture`.
    """
    texture = document.get("texture")
    return TERMS[document["model"]].texture if is_user_image(texture) else texture


def texture_slot(document: Mapping[str, Any]) -> int:
    """Texture slot of a term: 0 without a texture, else 1 + index in `TEXTURES`."""
    channel = texture_channel(document)
    return 0 if channel is None else 1 + TEXTURES.index(channel)


def user_images(documents: Sequence[Mapping[str, Any]]) -> Images:
    """Images in the terms of a material that replace each of `TEXTURES`."""
    images_by_slot: dict[int, str] = {
        texture_slot(document): document["texture"] for document in documents if is_user_image(document.get("texture"))
    }
    return images_by_slot.get(1), images_by_slot.get(2)


def roughness_image(documents: Sequence[Mapping[str, Any]]) -> str | None:
    """Image in the terms of a material that replaces its roughness map; None if there is none."""
    return next((name for document in documents if is_user_image(name := document.get("roughness_map"))), None)


def check_map(pointer: Pointer, roughness_map: Any) -> str | None:
    """Return a term's `roughness_map`, or raise ParameterError unless it is null, "roughness", or an uploaded image.

    Args:
        pointer: location in the look. roughness_map: the value there.
    """
    if roughness_map is None or (
        isinstance(roughness_map, str) and (roughness_map == ROUGHNESS or IMAGES.exists(roughness_map))
    ):
        return roughness_map
    raise invalid_value(pointer, roughness_map, f"null, {ROUGHNESS!r}, or an image that was uploaded to /api/images")


def check_image(pointer: Pointer, image: Any) -> str:
    """Return an image name in a look, or raise ParameterError unless the image was uploaded.

    Args:
        pointer: location in the look. image: the value there.
    """
    if isinstance(image, str) and IMAGES.exists(image):
        return image
    raise invalid_value(pointer, image, "an image that was uploaded to /api/images")


def check_texture(pointer: Pointer, texture: Any) -> str | None:
    """Return a term's `texture`, or raise ParameterError unless it is null, a channel, or an uploaded image.

    Args:
        pointer: location in the look. texture: the value there.
    """
    if texture is None or texture in TEXTURES or (isinstance(texture, str) and IMAGES.exists(texture)):
        return cast(str | None, texture)
    channels = " or ".join(map(repr, TEXTURES))
    raise invalid_value(pointer, texture, f"null, {channels}, or an image that was uploaded to /api/images")


def check_shared(pointer: Pointer, documents: Sequence[Mapping[str, Any]]) -> None:
    """Raise ParameterError if terms of one channel have different textures, or terms have different roughness maps.

    Args:
        pointer: location of the list in the look. documents: complete terms of one material.
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
    """Require one roughness map or none per material, because each sample has one roughness level."""
    image = roughness_image(documents)
    for k, document in enumerate(documents):
        roughness_map = document.get("roughness_map")
        if image is not None and roughness_map not in (None, image):
            allowed = f"null, or {image!r}, as other terms of this material have; change them together"
            raise invalid_value((*pointer, k, "roughness_map"), roughness_map, allowed)
