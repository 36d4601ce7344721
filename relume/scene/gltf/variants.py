"""KHR_materials_variants as looks: each variant says which material's terms a mesh takes instead of its own.

What a bake has fixed stays: a look cannot bring images, normals or texture placement. A term keeps its texture where
the variant's image is the same up to a colour, and has that image's mean otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from relume.brdf.document import complete_term
from relume.errors import SceneError
from relume.remarks import Remark, simplified
from relume.scene.coding import F64, mean_of, rows_of
from relume.scene.gltf.document import Document, Index, Name, Primitive
from relume.scene.gltf.materials import Understood
from relume.scene.gltf.names import unique_name
from relume.scene.model import F32, Texture

EXTENSION = "KHR_materials_variants"
SAME_IMAGE = 0.01  # relative RMS; two codings of one image differ by less
Choices = tuple[tuple[int, int], ...]


class Variant(BaseModel, frozen=True):
    """One way to dress the scene."""

    name: Name = ""


class Variants(BaseModel, frozen=True):
    """The extension at the document."""

    variants: Annotated[list[Variant], Field(max_length=100, fail_fast=True)] = []


class Exchange(BaseModel, frozen=True):
    """Which variants show a material."""

    material: Index
    variants: Annotated[list[Index], Field(max_length=100, fail_fast=True)] = []


class Mappings(BaseModel, frozen=True):
    """The extension at a primitive."""

    mappings: Annotated[list[Exchange], Field(max_length=100, fail_fast=True)] = []


def variant_names(document: Document) -> list[str]:
    """The names of the variants, each its own.

    Raises:
        SceneError: the extension is there and not valid.
    """
    taken: dict[str, int] = {}
    try:
        described = Variants.model_validate(document.extensions.get(EXTENSION, {}))
    except ValidationError:
        raise SceneError(f"{EXTENSION} of the file is not valid or lists over 100 variants; export it again") from None
    return [unique_name(variant.name or "variant", taken) for variant in described.variants]


def choices(primitive: Primitive) -> Choices:
    """(variant, material) pairs of a primitive that wears another material than its own.

    Raises:
        SceneError: the extension is there and not valid.
    """
    try:
        mapped = Mappings.model_validate(primitive.extensions.get(EXTENSION, {}))
    except ValidationError:
        raise SceneError(f"{EXTENSION} of a mesh is not valid; export the scene again") from None
    pairs = {variant: mapping.material for mapping in mapped.mappings for variant in mapping.variants}
    return tuple(sorted((variant, index) for variant, index in pairs.items() if index != primitive.material))


def variant_looks(
    names: Sequence[str],
    worn: Sequence[tuple[Understood, Choices]],
    wardrobe: Mapping[int, Understood],
    warnings: list[Remark],
) -> dict[str, dict[str, Any]]:
    """A partial look for each variant, the terms in it complete.

    Args:
        names: of the variants, in the order of the file.
        worn: the scene's materials, and what each is exchanged for.
        wardrobe: the materials that are exchanged for, by their number in the file.
        warnings: gets one sentence for each thing that a look cannot bring.
    """
    looks: dict[str, dict[str, Any]] = {name: {"materials": {}} for name in names}
    for own, exchanges in worn:
        for variant, index in exchanges:
            if variant < len(names):
                terms = _dressed(own, wardrobe[index], names[variant], warnings)
                looks[names[variant]]["materials"][own.material.name] = {"terms": terms}
    return looks


def _dressed(own: Understood, other: Understood, variant: str, warnings: list[Remark]) -> list[dict[str, Any]]:
    """The other material's terms, their textures looked for among those that the own material has baked."""
    what = f"variant {variant!r} of material {own.material.name!r}"
    if not _same_normals(own, other):
        warnings.append(simplified(f"{what} keeps the normal map it was baked with"))
    terms = []
    for given in other.material.terms:
        term = _smoothed(own, other, given, what, warnings)
        channel = term.get("texture")
        if channel is None:
            terms.append(term)
            continue
        image = other.material.textures[channel]
        kept, tint = _kept_channel(own, other, image)
        if kept is None and np.ptp(image.pixels, axis=(0, 1)).max() > 0:
            warnings.append(simplified(f"{what} has a texture of its own; its mean colour stands for it"))
        color = np.array(term["color"]) * tint
        terms.append(term | {"color": [round(float(value), 6) for value in color], "texture": kept})
    pointer = ("materials", own.material.name, "terms")
    return [complete_term((*pointer, number), term, None) for number, term in enumerate(terms)]


def _smoothed(
    own: Understood, other: Understood, term: dict[str, Any], what: str, warnings: list[Remark]
) -> dict[str, Any]:
    """A term that follows a map of roughness follows none where the own material has not the same."""
    mine, theirs = ("roughness" in one.material.textures for one in (own, other))
    if not term.get("roughness_map") or _same_image(own, other, "roughness") or not (mine or theirs):
        return term
    if theirs:
        warnings.append(simplified(f"{what} has a roughness texture of its own; its mean stands for it"))
    return {name: value for name, value in term.items() if name != "roughness_map"}


def _same_image(own: Understood, other: Understood, channel: str) -> bool:
    mine, theirs = own.material.textures.get(channel), other.material.textures.get(channel)
    if mine is None or theirs is None or own.uv_use != other.uv_use:
        return False
    return mine.coding == theirs.coding and np.array_equal(mine.pixels, theirs.pixels)


def _kept_channel(own: Understood, other: Understood, image: Texture) -> tuple[str | None, F32]:
    """The channel that holds the image up to a colour, and that colour; or None and the image's mean."""
    mean = _mean(image)
    if own.uv_use == other.uv_use:
        for channel, baked in own.material.textures.items():
            if baked.wrap != image.wrap or baked.pixels.shape != image.pixels.shape:
                continue
            tint = np.divide(mean, _mean(baked), out=np.zeros(3, np.float32), where=_mean(baked) > 0)
            if (_difference(baked, image, tint) <= SAME_IMAGE * mean.max()).all():
                return channel, tint
    return None, mean


def _difference(baked: Texture, image: Texture, tint: F32) -> F64:
    """Root of the mean square between an image and another times a colour. (3,)"""
    pairs = zip(rows_of(baked), rows_of(image), strict=True)
    total = sum(np.square(one * tint - other).sum((0, 1), dtype=np.float64) for one, other in pairs)
    return np.asarray(np.sqrt(total * 3 / image.pixels.size))


def _mean(image: Texture) -> F32:
    return mean_of(image).astype(np.float32)


def _same_normals(own: Understood, other: Understood) -> bool:
    mine, theirs = own.material.normal_map, other.material.normal_map
    if mine is None or theirs is None:
        return mine is theirs
    if own.uv_use != other.uv_use or mine.pixels.shape != theirs.pixels.shape:
        return False
    pairs = zip(rows_of(mine), rows_of(theirs), strict=True)
    return all(np.abs(one - other).max() < 1e-3 for one, other in pairs)
