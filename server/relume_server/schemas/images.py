"""Bodies of images that replace a material's textures."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from relume.look.document import MAX_TERMS
from relume_server.schemas.base import Body, Id, Name


class ImageBody(Body):
    """An image that looks can use instead of a material's own: as `texture` or `roughness_map` of its terms, or as its
    `normal_map`.

    `size`: width and height. `warnings`: changes made when its file was read. `roughness`: mean of its green channel,
    the roughness of a material that uses it as a map. For images made from a metallic map: `metalness` is the id of
    that map; `base` is its base color: an image, "diffuse" or "scene" for the scene's own textures, or null if it is
    constant.
    """

    id: str
    texture: str
    name: str
    created: str
    size: tuple[int, int]
    warnings: list[str]
    roughness: float
    metalness: str | None
    base: str | None
    thumbnail: str


class MetalnessRequest(Body):
    """A material to apply a metallic map to: its current `terms`, and the material whose textures they use."""

    scene: Id
    material: Name
    terms: Annotated[list[dict[str, Any]], Field(min_length=1, max_length=MAX_TERMS)]


class MetalnessBody(Body):
    """Terms that use the metallic map: textures of diffuse terms and highlights, and their mean f0."""

    terms: list[dict[str, Any]]
