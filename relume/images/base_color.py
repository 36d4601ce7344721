"""The base color of a material, inferred from its terms by inverting the import of metallic materials.

With the base color b, the metalness m, and the dielectric reflectance d at normal incidence, glTF imports compute

    D = b (1 - m),  F = d (1 - m) + b m   for diffuse terms and highlights (`relume.scene_io.surfaces.blend`)

so b = D + F - d (1 - m), where d (1 - m)² - (D + F) (1 - m) + D = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped

from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.brdf.texture_slots import is_user_image
from relume.core.errors import ParameterError
from relume.images.image_store import ImageRecipe, get_recipe, load_texture
from relume.images.read_image import limit_size
from relume.scene.model import Material, Texture
from relume.scene.texture_encoding import F32, F64, SRGB_TO_LINEAR, U8, encode_rows
from relume.scene_io.surfaces.blend import select_rows
from relume.scene_io.surfaces.texture_resampling import Raster, Wrap
from relume.scene_io.surfaces.to_terms import dielectric_reflectance

Document = Mapping[str, Any]
ReadMaterial = Callable[[str, str], Material]
"""Reads a scene's material by the scene's id and the material's name. Raises SceneError, NotFoundError."""

DIELECTRIC = 0.04
"""Default dielectric reflectance at normal incidence."""
_MAX_DIELECTRIC = 0.2  # about that of gems; higher reflectances must be partly metal
# precision of roots with 8-bit sRGB; of two roots as close as this, the less metallic is more likely
_ROOT_TOLERANCE, _NOISE = 0.02, 1e-6
_ONES = np.ones(3)


class BaseColor(NamedTuple):
    """A base color, with the reflectance of the dielectric part.

    Attributes:
        source: origin, as `relume.images.image_store.ImageRecipe.base`.
        pixels: sRGB bytes with alpha, and wrap modes; None for a uniform color.
        factor: multiplies the pixels; the color of diffuse terms. scale: also multiplies them, as part of the texture.
        dielectric: reflectance at normal incidence.
        scene, material: origin of the textures, or empty.
    """

    source: str | None
    pixels: tuple[Shaped[U8, "height width 4"], Wrap] | None
    factor: Shaped[F64, " 3"]
    dielectric: Shaped[F64, " 3"]
    scale: Shaped[F64, " 3"] = _ONES
    scene: str = ""
    material: str = ""


def base_color_terms(terms: Sequence[Document]) -> tuple[list[int], list[int]]:
    """Find the terms that show the base color of the dielectric and of the metallic part; first the one with f0.

    Args:
        terms: terms of a material, complete.
    Raises:
        ParameterError: there is no such term.
    """
    diffuse_indices = [k for k, term in enumerate(terms) if TERMS[term["model"]].texture == "diffuse"]
    specular_indices = [
        k for k, term in enumerate(terms) if TERMS[term["model"]].texture == "specular" and "f0" in term["params"]
    ]
    if not diffuse_indices or not specular_indices:
        allowed = "a diffuse term, such as lambert, and a highlight with f0, such as ggx; add the missing one"
        raise ParameterError("terms", [term["model"] for term in terms], allowed)
    specular_indices.sort(key=lambda k: terms[k]["texture"] is None)  # coats, which have no texture, come last
    return _with_same_texture(terms, diffuse_indices), _with_same_texture(terms, specular_indices)


def _with_same_texture(terms: Sequence[Document], term_indices: Sequence[int]) -> list[int]:
    """Indices of the terms with the same texture as the first."""
    return [k for k in term_indices if terms[k]["texture"] == terms[term_indices[0]]["texture"]]


def diffuse_fraction(dielectric: Shaped[F64, " 3"]) -> float:
    """Fraction of light that a dielectric transmits to its diffuse layer, as in imports."""
    return 1 - dielectric_reflectance(float(dielectric.max()), 1.0)


def find_base_color(
    diffuse_term: Document, specular_term: Document, scene: str, material: str, read: ReadMaterial
) -> BaseColor:
    """Infer the base color of a material.

    Args:
        diffuse_term, specular_term: the first of each list from `base_color_terms`.
        scene, material: origin of the terms' texture channels. read: reads that material.
    Raises:
        NotFoundError, SceneError: an image or the scene is unavailable.
    """
    texture_name, f0 = diffuse_term["texture"], _f0(specular_term)
    if is_user_image(texture_name) and (recipe := get_recipe(texture_name)) is not None:
        return _recompute_base(recipe, np.asarray(diffuse_term["color"], np.float64), read)
    channel_names = {
        name
        for term in (diffuse_term, specular_term)
        if (name := term["texture"]) is not None and not is_user_image(name)
    }
    scene_material = read(scene, material) if channel_names else None
    textures = (
        {}
        if scene_material is None
        else {name: scene_material.textures[name] for name in channel_names if name in scene_material.textures}
    )
    specular_texture = (
        specular_term["texture"]
        if is_user_image(specular_term["texture"]) or specular_term["texture"] in textures
        else None
    )
    is_plain = specular_texture is None and f0.max() <= _MAX_DIELECTRIC
    dielectric = f0 if is_plain else np.full(3, DIELECTRIC)
    factor = np.asarray(diffuse_term["color"], np.float64) / diffuse_fraction(dielectric)
    if is_user_image(texture_name):
        return _base_from_texture(texture_name, load_texture(texture_name), factor, dielectric)
    if is_plain:
        return _base_from_texture("diffuse", textures.get(texture_name), factor, dielectric, scene, material)
    if is_user_image(specular_texture):
        return _base_from_texture(specular_texture, load_texture(specular_texture), f0, dielectric)
    if scene_material is None or not textures:
        return BaseColor(None, None, solve_base_color(factor, f0), dielectric)
    return _base_from_texture("scene", _base_map(scene_material), _ONES, dielectric, scene, material)


def _recompute_base(recipe: ImageRecipe, color: F64, read: ReadMaterial) -> BaseColor:
    """Restore the base color that an earlier metalness image was applied to."""
    dielectric = np.array(recipe.dielectric)
    factor = color / diffuse_fraction(dielectric)
    if is_user_image(recipe.base):
        return _base_from_texture(recipe.base, load_texture(recipe.base), factor, dielectric)
    if recipe.base is None:
        return BaseColor(None, None, factor, dielectric)
    scene_material = read(recipe.scene, recipe.material)
    texture = scene_material.textures.get("diffuse") if recipe.base == "diffuse" else _base_map(scene_material)
    return _base_from_texture(recipe.base, texture, factor, dielectric, recipe.scene, recipe.material)


def _base_from_texture(
    source: str, texture: Texture | None, factor: F64, dielectric: F64, scene: str = "", material: str = ""
) -> BaseColor:
    if texture is None:
        return BaseColor(None, None, factor, dielectric)
    pixels, scale = _display_bytes(texture)
    return BaseColor(source, (pixels, texture.wrap), factor, dielectric, scale, scene, material)


def _display_bytes(texture: Texture) -> tuple[U8, F64]:
    """Convert a texture to sRGB bytes of limited size, and a scale. (height, width, 4), (3,)"""
    pixels = texture.pixels
    if texture.encoding is None:
        values, scale = pixels, np.maximum(pixels.max(axis=(0, 1)).astype(np.float64), 1e-6)
        pixels = encode_rows(lambda rows: values[rows].astype(np.float32), values.shape[:2], scale, texture.wrap).pixels
    else:
        scale = np.array(texture.encoding.scale)
    pixels = limit_size(pixels)
    opaque = np.full((*pixels.shape[:2], 1), 255, np.uint8)
    return np.concatenate([pixels, opaque], axis=-1), scale


def _base_map(scene_material: Material) -> Texture:
    """Base color of a scene's material with diffuse and specular textures, texel by texel.

    Raises:
        ParameterError: its terms in the scene are not those of glTF materials.
    """
    terms = [complete_term(("terms", k), term, None) for k, term in enumerate(scene_material.terms)]
    diffuse_term, specular_term = (terms[indices[0]] for indices in base_color_terms(terms))
    channel_color = {
        "diffuse": np.asarray(diffuse_term["color"], np.float64) / diffuse_fraction(np.full(3, DIELECTRIC)),
        "specular": _f0(specular_term),
    }
    images: dict[str, tuple[U8, Wrap]] = {}
    for channel in channel_color:
        if (texture := scene_material.textures.get(channel)) is not None:
            pixels, scale = _display_bytes(texture)
            images[channel], channel_color[channel] = (pixels, texture.wrap), channel_color[channel] * scale
    raster = Raster(images)

    def values(rows: slice) -> F32:
        reflectances = [
            scale * SRGB_TO_LINEAR[select_rows(raster.rgb(key), rows)] for key, scale in channel_color.items()
        ]
        return np.asarray(solve_base_color(*reflectances), np.float32)

    return encode_rows(values, raster.size if images else (1, 1), _ONES, raster.wrap)


def solve_base_color(diffuse: F64, specular: F64) -> F64:
    """Solve for b from D and F. The mean over channels has the roots 1 - m and b / d. If both are possible values of
    1 - m, choose the one that fits the differences between channels, or else the less metallic. (..., 3) each"""
    total = diffuse + specular
    mean, diffuse_mean = (values.mean(axis=-1, keepdims=True) for values in (total, diffuse))
    root = np.sqrt(np.maximum(mean**2 - 4 * DIELECTRIC * diffuse_mean, 0))
    smaller_root, larger_root = 2 * diffuse_mean / np.maximum(mean + root, 1e-9), (mean + root) / (2 * DIELECTRIC)

    def squared_residual(dielectric_weight: F64) -> F64:
        residual = diffuse - diffuse_mean - dielectric_weight * (total - mean)
        return np.asarray((residual**2).sum(axis=-1, keepdims=True))

    use_smaller = (larger_root > 1 + _ROOT_TOLERANCE) | (
        squared_residual(smaller_root) + _NOISE < squared_residual(larger_root)
    )
    return np.asarray(
        np.clip(total - DIELECTRIC * np.minimum(np.where(use_smaller, smaller_root, larger_root), 1), 0, 1)
    )


def _f0(term: Document) -> F64:
    """Reflectance of a highlight at normal incidence. (3,)"""
    return np.broadcast_to(np.asarray(term["params"]["f0"], np.float64), 3)
