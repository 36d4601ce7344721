"""The base colour of a material, found from its terms: imports keep what it scatters and what its highlights reflect.

With b the base colour, m the metalness, and d the reflectance head-on of what is no metal, files of glTF have

    D = b (1 - m),  F = d (1 - m) + b m   of what scatters and of highlights (`relume.scene_io.gltf.blend`)

so b = D + F - d (1 - m), where d (1 - m)² - (D + F) (1 - m) + D = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.brdf.texture_slots import is_user_image
from relume.core.errors import ParameterError
from relume.images.image_store import ImageRecipe, get_recipe, load_texture
from relume.images.read_image import limit_size
from relume.scene.model import Material, Texture
from relume.scene.texture_encoding import F32, F64, SRGB_TO_LINEAR, U8
from relume.scene.texture_encoding import encode_rows as coded
from relume.scene_io.gltf.blend import select_rows
from relume.scene_io.gltf.texture_resampling import Raster, Wrap
from relume.scene_io.gltf.to_terms import dielectric_reflectance

Document = Mapping[str, Any]
ReadMaterial = Callable[[str, str], Material]
"""Reads a scene's material by the scene's id and the material's name. Raises SceneError, NotFoundError."""

DIELECTRIC = 0.04
"""Reflectance head-on of what is no metal, where a material does not say it."""
_MAX_DIELECTRIC = 0.2  # of gems, about: what reflects more than that head-on is metal somewhere
# bytes of display values say it no better; of what is as near, the less metal is likelier
_ROOT_TOLERANCE, _NOISE = 0.02, 1e-6
_ONES = np.ones(3)


class BaseColor(NamedTuple):
    """A base colour, and what is no metal with it.

    Attributes:
        source: what it comes from, as `relume.images.image_store.ImageRecipe.base`.
        pixels: display values and how they wrap; None where it is the same everywhere. (height, width, 4) uint8
        factor: that multiplies it, and is the colour of what scatters; scale: multiplies it as well, as part of the
            texture. dielectric: reflectance head-on of what is no metal. (3,) each
        scene, material: whose own textures it is; empty where it is not.
    """

    source: str | None
    pixels: tuple[U8, Wrap] | None
    factor: F64
    dielectric: F64
    scale: F64 = _ONES
    scene: str = ""
    material: str = ""


def base_color_terms(terms: Sequence[Document]) -> tuple[list[int], list[int]]:
    """Which terms show the base colour of what is no metal, and which of metals; first the highlight that has f0.

    Args:
        terms: of a material, complete.
    Raises:
        ParameterError: there is no such term.
    """
    diffuse_indices = [k for k, term in enumerate(terms) if TERMS[term["model"]].texture == "diffuse"]
    specular_indices = [
        k for k, term in enumerate(terms) if TERMS[term["model"]].texture == "specular" and "f0" in term["params"]
    ]
    if not diffuse_indices or not specular_indices:
        allowed = "a term that scatters light, such as lambert, and one with f0, such as ggx: add what is missing"
        raise ParameterError("terms", [term["model"] for term in terms], allowed)
    specular_indices.sort(key=lambda k: terms[k]["texture"] is None)  # coats have no texture, and lie over what has one
    return _with_same_texture(terms, diffuse_indices), _with_same_texture(terms, specular_indices)


def _with_same_texture(terms: Sequence[Document], term_indices: Sequence[int]) -> list[int]:
    """Those that have the texture of the first."""
    return [k for k in term_indices if terms[k]["texture"] == terms[term_indices[0]]["texture"]]


def diffuse_fraction(dielectric: F64) -> float:
    """The share of light that what is no metal does not reflect before it scatters, as imports have it."""
    return 1 - dielectric_reflectance(float(dielectric.max()), 1.0)


def find_base_color(
    diffuse_term: Document, specular_term: Document, scene: str, material: str, read: ReadMaterial
) -> BaseColor:
    """Find the base colour of a material.

    Args:
        diffuse_term, specular_term: the first of each of its `places`.
        scene, material: whose textures the terms name by channel. read: that material.
    Raises:
        NotFoundError, SceneError: an image or the scene cannot be had.
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
        return BaseColor(None, None, _solve_base_color(factor, f0), dielectric)
    return _base_from_texture("scene", _base_map(scene_material), _ONES, dielectric, scene, material)


def _recompute_base(recipe: ImageRecipe, color: F64, read: ReadMaterial) -> BaseColor:
    """That which was under another image of metalness."""
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
    """A texture as display values, no more than images may have, and what multiplies them. (height, width, 4), (3,)"""
    pixels = texture.pixels
    if texture.encoding is None:
        values, scale = pixels, np.maximum(pixels.max(axis=(0, 1)).astype(np.float64), 1e-6)
        pixels = coded(lambda rows: values[rows].astype(np.float32), values.shape[:2], scale, texture.wrap).pixels
    else:
        scale = np.array(texture.encoding.scale)
    pixels = limit_size(pixels)
    opaque = np.full((*pixels.shape[:2], 1), 255, np.uint8)
    return np.concatenate([pixels, opaque], axis=-1), scale


def _base_map(scene_material: Material) -> Texture:
    """The base colour, texel by texel, of a scene's material whose own textures share it out.

    Raises:
        ParameterError: it has other terms in the scene than materials of glTF have.
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
        return np.asarray(_solve_base_color(*reflectances), np.float32)

    return coded(values, raster.size if images else (1, 1), _ONES, raster.wrap)


def _solve_base_color(diffuse: F64, specular: F64) -> F64:
    """b of D and F. The mean of the channels has the roots 1 - m and b / d; where both may be 1 - m, that is by which D
    rises with D + F from channel to channel, else the less metallic. (..., 3) each"""
    total = diffuse + specular
    mean, diffuse_mean = (values.mean(axis=-1, keepdims=True) for values in (total, diffuse))
    root = np.sqrt(np.maximum(mean**2 - 4 * DIELECTRIC * diffuse_mean, 0))
    smaller_root, larger_root = 2 * diffuse_mean / np.maximum(mean + root, 1e-9), (mean + root) / (2 * DIELECTRIC)

    def squared_residual(no_metal: F64) -> F64:
        residual = diffuse - diffuse_mean - no_metal * (total - mean)
        return np.asarray((residual**2).sum(axis=-1, keepdims=True))

    use_smaller = (larger_root > 1 + _ROOT_TOLERANCE) | (
        squared_residual(smaller_root) + _NOISE < squared_residual(larger_root)
    )
    return np.asarray(
        np.clip(total - DIELECTRIC * np.minimum(np.where(use_smaller, smaller_root, larger_root), 1), 0, 1)
    )


def _f0(term: Document) -> F64:
    """Reflectance head-on of a highlight. (3,)"""
    return np.broadcast_to(np.asarray(term["params"]["f0"], np.float64), 3)
