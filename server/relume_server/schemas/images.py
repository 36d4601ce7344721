"""Bodies of images that looks may name in the place of a material's own."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from relume.look.document import MAX_TERMS
from relume_server.schemas.base import Body, Id, Name


class ImageBody(Body):
    """An image that looks may name in the place of a material's own: `texture` or `roughness_map` of its terms, its
    `normal_map`.

    `size`: width and height. `warnings`: what was changed when its file was read. `roughness`: the mean of its green,
    how rough a material is that has it as its map. `metalness`: of one that was made and not sent, the image that says
    where it is metal; `base`: its base colour, an image, "diffuse" or "scene" of the scene's own textures, or null
    where that is the same everywhere.
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
    """A material that an image of metalness is for: its `terms` as they are, and whose own textures these name."""

    scene: Id
    material: Name
    terms: Annotated[list[dict[str, Any]], Field(min_length=1, max_length=MAX_TERMS)]


class MetalnessBody(Body):
    """What its terms become: textures of what scatters light and of highlights, and their mean f0."""

    terms: list[dict[str, Any]]
