"""KHR_materials_variants as looks: each variant replaces the terms of materials.

A look cannot replace the textures, normals or UV coordinates of a bake. A term keeps its texture if the variant's image
is the same up to a color, and otherwise gets that image's mean.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BaseModel, Field

from relume.brdf.term_validation import complete_term
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported
from relume.scene.model import F32, Texture
from relume.scene.texture_encoding import F64, decode_rows, mean_value
from relume.scene.unique_names import unique_name
from relume.scene_io.gltf.document import Document, Extensions, Index, Name, Primitive
from relume.scene_io.gltf.tolerant import read_object
from relume.scene_io.surfaces.make_material import ReadMaterial

EXTENSION = "KHR_materials_variants"
SAME_IMAGE = 0.01  # relative RMS; different compressions of an image differ by less
Choices = tuple[tuple[int, int], ...]
M = TypeVar("M", bound=BaseModel)


class Variant(BaseModel, frozen=True):
    """One variant of the scene."""

    name: Name = ""


class Variants(BaseModel, frozen=True):
    """The extension at the document."""

    variants: Annotated[list[Variant], Field(max_length=100, fail_fast=True)] = []


class VariantMaterial(BaseModel, frozen=True):
    """A material and the variants that use it."""

    material: Index
    variants: Annotated[list[Index], Field(max_length=100, fail_fast=True)] = []


class VariantMap(BaseModel, frozen=True):
    """The extension at a primitive."""

    mappings: Annotated[list[VariantMaterial], Field(max_length=100, fail_fast=True)] = []


def variant_names(document: Document, warnings: list[ImporterWarning]) -> list[str]:
    """Return unique names of the variants; none if the extension is invalid, with a warning."""
    used_names: dict[str, int] = {}
    extension = _read(Variants, document.root.extensions, "the file", warnings)
    return [unique_name(variant.name or "variant", used_names) for variant in extension.variants]


def read_choices(primitive: Primitive, label: str, warnings: list[ImporterWarning]) -> Choices:
    """Return (variant, material) pairs for the variants that replace a primitive's material.

    Args:
        primitive: from the document. label: names it in warnings.
        warnings: gets a sentence if the extension is invalid; there are no pairs then.
    """
    extension = _read(VariantMap, primitive.extensions, label, warnings)
    pairs = {variant: mapping.material for mapping in extension.mappings for variant in mapping.variants}
    return tuple(sorted((variant, index) for variant, index in pairs.items() if index != primitive.material))


def _read(model: type[M], extensions: Extensions, label: str, warnings: list[ImporterWarning]) -> M:
    try:
        return read_object(model, extensions.get(EXTENSION, {}), f"{EXTENSION} of {label}", warnings)
    except SceneError as problem:
        warnings.append(unsupported(f"Material variants were left out: {problem}."))
        return model()


def variant_looks(
    names: Sequence[str],
    scene_materials: Sequence[tuple[ReadMaterial, Choices]],
    variant_materials: Mapping[int, ReadMaterial],
    warnings: list[ImporterWarning],
) -> dict[str, dict[str, Any]]:
    """Return a partial look for each variant, with complete terms.

    Args:
        names: names of the variants, in file order.
        scene_materials: the scene's materials, with their replacements.
        variant_materials: the replacement materials by their index in the file.
        warnings: gets one sentence for each feature that a look cannot replace.
    """
    looks: dict[str, dict[str, Any]] = {name: {"materials": {}} for name in names}
    for target, choices in scene_materials:
        for variant, index in choices:
            if 0 <= variant < len(names):
                terms = _variant_terms(target, variant_materials[index], names[variant], warnings)
                looks[names[variant]]["materials"][target.material.name] = {"terms": terms}
    return looks


def _variant_terms(
    target: ReadMaterial, source: ReadMaterial, variant: str, warnings: list[ImporterWarning]
) -> list[dict[str, Any]]:
    """Terms of the replacement material; its textures are matched with those of the scene's material."""
    label = f"variant {quote(variant)} of material {quote(target.material.name)}"
    if not _has_same_normals(target, source):
        warnings.append(approximated(f"The normal map of {label} isn't supported; it keeps the original one."))
    terms = []
    for source_term in source.material.terms:
        term = _drop_unmatched_roughness(target, source, source_term, label, warnings)
        channel = term.get("texture")
        if channel is None:
            terms.append(term)
            continue
        image = source.material.textures[channel]
        matching_channel, tint = _find_matching_channel(target, source, image)
        if matching_channel is None and np.ptp(image.pixels, axis=(0, 1)).max() > 0:
            warnings.append(approximated(f"The texture of {label} isn't supported; it has its average color."))
        color = np.array(term["color"]) * tint
        terms.append(term | {"color": [round(float(value), 6) for value in color], "texture": matching_channel})
    pointer = ("materials", target.material.name, "terms")
    return [complete_term((*pointer, number), term, None) for number, term in enumerate(terms)]


def _drop_unmatched_roughness(
    target: ReadMaterial, source: ReadMaterial, term: dict[str, Any], label: str, warnings: list[ImporterWarning]
) -> dict[str, Any]:
    """Remove the roughness map of a term if the scene's material has a different one."""
    target_has_map, source_has_map = (
        "roughness" in read_material.material.textures for read_material in (target, source)
    )
    if (
        not term.get("roughness_map")
        or _has_same_image(target, source, "roughness")
        or not (target_has_map or source_has_map)
    ):
        return term
    if source_has_map:
        warnings.append(approximated(f"The roughness texture of {label} isn't supported; it has its average."))
    return {name: value for name, value in term.items() if name != "roughness_map"}


def _has_same_image(target: ReadMaterial, source: ReadMaterial, channel: str) -> bool:
    target_texture, source_texture = target.material.textures.get(channel), source.material.textures.get(channel)
    if target_texture is None or source_texture is None or target.uv_slot != source.uv_slot:
        return False
    return target_texture.encoding == source_texture.encoding and np.array_equal(
        target_texture.pixels, source_texture.pixels
    )


def _find_matching_channel(target: ReadMaterial, source: ReadMaterial, image: Texture) -> tuple[str | None, F32]:
    """The channel with the same image up to a color, and that color; or None and the image's mean."""
    mean = _mean(image)
    if target.uv_slot == source.uv_slot:
        for channel, target_texture in target.material.textures.items():
            if target_texture.wrap != image.wrap or target_texture.pixels.shape != image.pixels.shape:
                continue
            tint = np.divide(mean, _mean(target_texture), out=np.zeros(3, np.float32), where=_mean(target_texture) > 0)
            if (_rms_difference(target_texture, image, tint) <= SAME_IMAGE * mean.max()).all():
                return channel, tint
    return None, mean


def _rms_difference(target_texture: Texture, image: Texture, tint: F32) -> F64:
    """RMS difference between an image and another one times a color. (3,)"""
    pairs = zip(decode_rows(target_texture), decode_rows(image), strict=True)
    total = sum(
        np.square(baked_rows * tint - image_rows).sum((0, 1), dtype=np.float64) for baked_rows, image_rows in pairs
    )
    return np.asarray(np.sqrt(total * 3 / image.pixels.size))


def _mean(image: Texture) -> F32:
    return mean_value(image).astype(np.float32)


def _has_same_normals(target: ReadMaterial, source: ReadMaterial) -> bool:
    target_map, source_map = target.material.normal_map, source.material.normal_map
    if target_map is None or source_map is None:
        return target_map is source_map
    if target.uv_slot != source.uv_slot or target_map.pixels.shape != source_map.pixels.shape:
        return False
    pairs = zip(decode_rows(target_map), decode_rows(source_map), strict=True)
    return all(np.abs(target_rows - source).max() < 1e-3 for target_rows, source in pairs)
