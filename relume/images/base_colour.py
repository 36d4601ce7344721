"""The base colour of a material, found from its terms: imports keep what it scatters and what its highlights reflect.

With b the base colour, m the metalness, and d the reflectance head-on of what is no metal, files of glTF have

    D = b (1 - m),  F = d (1 - m) + b m   of what scatters and of highlights (`relume.scene.gltf.blend`)

so b = D + F - d (1 - m), where d (1 - m)² - (D + F) (1 - m) + D = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from relume.brdf.channels import is_image
from relume.brdf.document import complete_term
from relume.brdf.registry import TERMS
from relume.errors import ParameterError
from relume.images.reading import held
from relume.images.shelf import MadeOf, made_of, texture_of
from relume.scene.coding import F32, F64, SRGB_TO_LINEAR, U8
from relume.scene.coding import made_of as coded
from relume.scene.gltf.blend import rows_of
from relume.scene.gltf.raster import Raster, Wrap
from relume.scene.gltf.terms import dielectric_share
from relume.scene.model import Material, Texture

Document = Mapping[str, Any]
ReadMaterial = Callable[[str, str], Material]
"""Reads a scene's material by the scene's id and the material's name. Raises SceneError, NotFoundError."""

DIELECTRIC = 0.04
"""Reflectance head-on of what is no metal, where a material does not say it."""
_MOST_DIELECTRIC = 0.2  # of gems, about: what reflects more than that head-on is metal somewhere
_NEAR, _NOISE = 0.02, 1e-6  # bytes of display values say it no better; of what is as near, the less metal is likelier
_ONES = np.ones(3)


class Base(NamedTuple):
    """A base colour, and what is no metal with it.

    Attributes:
        said: what it comes from, as `relume.images.shelf.MadeOf.base`.
        pixels: display values and how they wrap; None where it is the same everywhere. (height, width, 4) uint8
        factor: that multiplies it, and is the colour of what scatters; scale: multiplies it as well, as part of the
            texture. dielectric: reflectance head-on of what is no metal. (3,) each
        scene, material: whose own textures it is; empty where it is not.
    """

    said: str | None
    pixels: tuple[U8, Wrap] | None
    factor: F64
    dielectric: F64
    scale: F64 = _ONES
    scene: str = ""
    material: str = ""


def places(terms: Sequence[Document]) -> tuple[list[int], list[int]]:
    """Which terms show the base colour of what is no metal, and which of metals; first the highlight that has f0.

    Args:
        terms: of a material, complete.
    Raises:
        ParameterError: there is no such term.
    """
    scatters = [k for k, term in enumerate(terms) if TERMS[term["model"]].texture == "diffuse"]
    shines = [
        k for k, term in enumerate(terms) if TERMS[term["model"]].texture == "specular" and "f0" in term["params"]
    ]
    if not scatters or not shines:
        allowed = "a term that scatters light, such as lambert, and one with f0, such as ggx: add what is missing"
        raise ParameterError("terms", [term["model"] for term in terms], allowed)
    shines.sort(key=lambda k: terms[k]["texture"] is None)  # coats have no texture, and lie over what has one
    return _alike(terms, scatters), _alike(terms, shines)


def _alike(terms: Sequence[Document], found: Sequence[int]) -> list[int]:
    """Those that have the texture of the first."""
    return [k for k in found if terms[k]["texture"] == terms[found[0]]["texture"]]


def scattered(dielectric: F64) -> float:
    """The share of light that what is no metal does not reflect before it scatters, as imports have it."""
    return 1 - dielectric_share(float(dielectric.max()), 1.0)


def base_of(scatters: Document, shines: Document, scene: str, material: str, read: ReadMaterial) -> Base:
    """Find the base colour of a material.

    Args:
        scatters, shines: the first of each of its `places`.
        scene, material: whose textures the terms name by channel. read: that material.
    Raises:
        NotFoundError, SceneError: an image or the scene cannot be had.
    """
    named, f0 = scatters["texture"], _f0_of(shines)
    if is_image(named) and (before := made_of(named)) is not None:
        return _again(before, np.asarray(scatters["color"], np.float64), read)
    asked = {name for term in (scatters, shines) if (name := term["texture"]) is not None and not is_image(name)}
    own = read(scene, material) if asked else None
    textures = {} if own is None else {name: own.textures[name] for name in asked if name in own.textures}
    reflects = shines["texture"] if is_image(shines["texture"]) or shines["texture"] in textures else None
    is_plain = reflects is None and f0.max() <= _MOST_DIELECTRIC
    dielectric = f0 if is_plain else np.full(3, DIELECTRIC)
    factor = np.asarray(scatters["color"], np.float64) / scattered(dielectric)
    if is_image(named):
        return _of_texture(named, texture_of(named), factor, dielectric)
    if is_plain:
        return _of_texture("diffuse", textures.get(named), factor, dielectric, scene, material)
    if is_image(reflects):
        return _of_texture(reflects, texture_of(reflects), f0, dielectric)
    if own is None or not textures:
        return Base(None, None, _unmixed(factor, f0), dielectric)
    return _of_texture("scene", _base_map(own), _ONES, dielectric, scene, material)


def _again(before: MadeOf, color: F64, read: ReadMaterial) -> Base:
    """That which was under another image of metalness."""
    dielectric = np.array(before.dielectric)
    factor = color / scattered(dielectric)
    if is_image(before.base):
        return _of_texture(before.base, texture_of(before.base), factor, dielectric)
    if before.base is None:
        return Base(None, None, factor, dielectric)
    own = read(before.scene, before.material)
    texture = own.textures.get("diffuse") if before.base == "diffuse" else _base_map(own)
    return _of_texture(before.base, texture, factor, dielectric, before.scene, before.material)


def _of_texture(
    said: str, texture: Texture | None, factor: F64, dielectric: F64, scene: str = "", material: str = ""
) -> Base:
    if texture is None:
        return Base(None, None, factor, dielectric)
    pixels, scale = _bytes_of(texture)
    return Base(said, (pixels, texture.wrap), factor, dielectric, scale, scene, material)


def _bytes_of(texture: Texture) -> tuple[U8, F64]:
    """A texture as display values, no more than images may have, and what multiplies them. (height, width, 4), (3,)"""
    pixels = texture.pixels
    if texture.coding is None:
        values, scale = pixels, np.maximum(pixels.max(axis=(0, 1)).astype(np.float64), 1e-6)
        pixels = coded(lambda rows: values[rows].astype(np.float32), values.shape[:2], scale, texture.wrap).pixels
    else:
        scale = np.array(texture.coding.scale)
    pixels = held(pixels)
    opaque = np.full((*pixels.shape[:2], 1), 255, np.uint8)
    return np.concatenate([pixels, opaque], axis=-1), scale


def _base_map(own: Material) -> Texture:
    """The base colour, texel by texel, of a scene's material whose own textures share it out.

    Raises:
        ParameterError: it has other terms in the scene than materials of glTF have.
    """
    terms = [complete_term(("terms", k), term, None) for k, term in enumerate(own.terms)]
    scatters, shines = (terms[of[0]] for of in places(terms))
    of_channel = {
        "diffuse": np.asarray(scatters["color"], np.float64) / scattered(np.full(3, DIELECTRIC)),
        "specular": _f0_of(shines),
    }
    images: dict[str, tuple[U8, Wrap]] = {}
    for channel in of_channel:
        if (texture := own.textures.get(channel)) is not None:
            pixels, scale = _bytes_of(texture)
            images[channel], of_channel[channel] = (pixels, texture.wrap), of_channel[channel] * scale
    raster = Raster(images)

    def values(rows: slice) -> F32:
        shown = [scale * SRGB_TO_LINEAR[rows_of(raster.rgb(key), rows)] for key, scale in of_channel.items()]
        return np.asarray(_unmixed(*shown), np.float32)

    return coded(values, raster.size if images else (1, 1), _ONES, raster.wrap)


def _unmixed(scatters: F64, reflects: F64) -> F64:
    """b of D and F. The mean of the channels has the roots 1 - m and b / d; where both may be 1 - m, that is by which D
    rises with D + F from channel to channel, else the less metallic. (..., 3) each"""
    total = scatters + reflects
    mean, of_scattered = (values.mean(axis=-1, keepdims=True) for values in (total, scatters))
    root = np.sqrt(np.maximum(mean**2 - 4 * DIELECTRIC * of_scattered, 0))
    less, more = 2 * of_scattered / np.maximum(mean + root, 1e-9), (mean + root) / (2 * DIELECTRIC)

    def missed(no_metal: F64) -> F64:
        apart = scatters - of_scattered - no_metal * (total - mean)
        return np.asarray((apart**2).sum(axis=-1, keepdims=True))

    is_less = (more > 1 + _NEAR) | (missed(less) + _NOISE < missed(more))
    return np.asarray(np.clip(total - DIELECTRIC * np.minimum(np.where(is_less, less, more), 1), 0, 1))


def _f0_of(term: Document) -> F64:
    """Reflectance head-on of a highlight. (3,)"""
    return np.broadcast_to(np.asarray(term["params"]["f0"], np.float64), 3)
