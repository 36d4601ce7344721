"""What multiplies a term's colour: an image of its material by channel, or one that its look names in that place.

Terms of one channel share what multiplies them: finished pictures are summed by channel before textures are looked up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeGuard, cast

from relume.asset_store import AssetStore
from relume.brdf.registry import TERMS
from relume.checks import Pointer, fail
from relume.errors import SceneError

TEXTURES = ("diffuse", "specular")

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
"""Where such images are kept, by `relume.images.shelf`."""


def is_image(texture: str | bool | None) -> TypeGuard[str]:
    """Whether a term's `texture` or `roughness_map` names an image rather than one of the material's own."""
    return isinstance(texture, str) and texture.startswith(IMAGES.prefix)


def channel_of(document: Mapping[str, Any]) -> str | None:
    """The channel of a term's texture: that which it names, or that which its model takes where it names an image.

    Args:
        document: a term, with its `model` and `texture`.
    """
    texture = document.get("texture")
    return TERMS[document["model"]].texture if is_image(texture) else texture


def group_of(document: Mapping[str, Any]) -> int:
    """Number of the sum that a term is part of: 0 without a texture, 1 + place in `TEXTURES` with one. document: it"""
    channel = channel_of(document)
    return 0 if channel is None else 1 + TEXTURES.index(channel)


def images_of(documents: Sequence[Mapping[str, Any]]) -> Images:
    """What the terms of a material name in the place of each of `TEXTURES`. documents: its terms"""
    found: dict[int, str] = {group_of(one): one["texture"] for one in documents if is_image(one.get("texture"))}
    return found.get(1), found.get(2)


def roughness_image(documents: Sequence[Mapping[str, Any]]) -> str | None:
    """What the terms of a material name in the place of its map of roughness; None where they name nothing.

    Args:
        documents: its terms.
    """
    return next((name for one in documents if is_image(name := one.get("roughness_map"))), None)


def check_map(pointer: Pointer, follows: Any) -> bool | str:
    """A term's `roughness_map`. Raises ParameterError unless it is yes, no, or an image that is here.

    Args:
        pointer: where it stands in its look. follows: what stands there.
    """
    if isinstance(follows, bool) or (isinstance(follows, str) and IMAGES.is_known(follows)):
        return follows
    raise fail(pointer, follows, "true, false, or an image that was sent to /api/images and is here")


def check_image(pointer: Pointer, image: Any) -> str:
    """An image that a look names. Raises ParameterError unless it is here.

    Args:
        pointer: where it stands in its look. image: what stands there.
    """
    if isinstance(image, str) and IMAGES.is_known(image):
        return image
    raise fail(pointer, image, "an image that was sent to /api/images and is here")


def check_texture(pointer: Pointer, texture: Any) -> str | None:
    """A term's `texture`. Raises ParameterError unless it is a channel, an image that is here, or nothing.

    Args:
        pointer: where it stands in its look. texture: what stands there.
    """
    if texture is None or texture in TEXTURES or (isinstance(texture, str) and IMAGES.is_known(texture)):
        return cast(str | None, texture)
    channels = " or ".join(map(repr, TEXTURES))
    raise fail(pointer, texture, f"null, {channels}, or an image that was sent to /api/images and is here")


def check_shared(pointer: Pointer, documents: Sequence[Mapping[str, Any]]) -> None:
    """Raises ParameterError where terms of one channel are multiplied by different textures, or follow different maps.

    Args:
        pointer: where the list stands in its look. documents: complete terms of one material.
    """
    _check_one_map(pointer, documents)
    textures: dict[int, str | None] = {}
    for k, document in enumerate(documents):
        texture = document["texture"]
        first = textures.setdefault(group_of(document), texture)
        if texture != first:
            channel = channel_of(document)
            allowed = f"{first!r}, as the other {channel} terms of this material have; change them together"
            raise fail((*pointer, k, "texture"), texture, allowed)


def _check_one_map(pointer: Pointer, documents: Sequence[Mapping[str, Any]]) -> None:
    """Samples of a material have one level of roughness each: its terms follow one map, or none."""
    image = roughness_image(documents)
    for k, document in enumerate(documents):
        follows = document.get("roughness_map", False)
        if image is not None and follows not in (False, image):
            allowed = f"false, or {image!r}, as other terms of this material have; change them together"
            raise fail((*pointer, k, "roughness_map"), follows, allowed)
