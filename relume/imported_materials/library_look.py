"""An imported material as the partial look of any object: its textures become uploaded images."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from relume.brdf.texture_slots import ROUGHNESS, TEXTURES
from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.images.image_store import store_texture
from relume.images.read_image import MAX_SIDE, limit_size
from relume.look.glass import default_glass
from relume.scene.model import Texture
from relume.scene_io.surfaces.make_material import ReadMaterial
from relume.scene_io.surfaces.uv_transforms import UvSlot, tiling


def library_look(read: ReadMaterial, images: Path, warnings: list[ImporterWarning]) -> dict[str, Any]:
    """Return `terms`, and `normal_map` and `glass` if the material has them, as in a look.

    Args:
        read: the material. images: folder of the image store, which gets its textures.
        warnings: gets a sentence for what belongs to the surface of an object, not to a look.
    Raises:
        SceneError: the image store is full.
    """
    material, label = read.material, f"material {quote(read.material.name)}"
    _warn_of_surface(read, label, warnings)
    textures = dict(material.textures) | ({} if material.normal_map is None else {"normal": material.normal_map})
    used = [channel for channel in (*TEXTURES, ROUGHNESS, "normal") if channel in textures]
    if used and tiling(read.uv_slot, UvSlot(read.uv_slot.uv_set)) is None:
        message = f"Texture coordinates of {label} are moved or scaled in the file; an object has its own."
        warnings.append(unsupported(message))
    names = {}
    for channel in used:
        texture = _tiled(textures[channel], read.uv_slot)
        names[channel] = store_texture(images, f"{material.name[:60]}, {channel}", texture).texture
    terms = [_with_images(term, names) for term in material.terms]
    normals = {}
    if material.normal_map is not None and material.normal_map.encoding is not None:
        normals = {"normal_map": {"image": names["normal"], "scale": material.normal_map.encoding.scale[0]}}
    glass = {} if material.glass is None else {"glass": default_glass(material.glass)}
    return {"terms": terms, **normals, **glass}


def _warn_of_surface(read: ReadMaterial, label: str, warnings: list[ImporterWarning]) -> None:
    sentences = {
        f"Emission of {label} isn't imported; add a mesh light to the object.": any(read.emission),
        f"Opacity of {label} isn't imported; it comes with the scene.": read.material.opacity is not None,
        f"Transmission of {label} shows only on objects that are glass in the scene.": read.material.glass is not None,
        f"The rotated highlight of {label} follows the tangents of the object.": bool(read.tangent_rotation),
    }
    warnings += [unsupported(sentence) for sentence, applies in sentences.items() if applies]


def _tiled(texture: Texture, slot: UvSlot) -> Texture:
    """The texture for unscaled UV coordinates, at most `MAX_SIDE` wide and high, with three channels."""
    pixels, layout = texture.pixels, tiling(slot, UvSlot(slot.uv_set))
    if pixels.shape[2] == 1:
        pixels = np.repeat(pixels, 3, axis=2)
    if layout is None or max(layout[0]) > MAX_SIDE or texture.wrap != ("repeat", "repeat"):
        return replace(texture, pixels=limit_size(pixels))
    (across, down), (right, below) = layout
    factor = -(-max(pixels.shape[0] * down, pixels.shape[1] * across) // MAX_SIDE)
    if factor > 1:
        pixels = np.asarray(Image.fromarray(pixels).reduce(factor))
    height, width = pixels.shape[:2]
    shift = round(-below * height) % height, round(-right * width) % width
    return replace(
        texture, pixels=np.tile(np.roll(pixels, shift, axis=(0, 1)), (down, across, 1))[:MAX_SIDE, :MAX_SIDE]
    )


def _with_images(term: dict[str, Any], names: dict[str, str]) -> dict[str, Any]:
    """A term with uploaded images instead of the material's own."""
    images = {"texture": names.get(term.get("texture") or "")}
    if ROUGHNESS in names and term.get("roughness_map") == ROUGHNESS:
        images["roughness_map"] = names[ROUGHNESS]
    return {key: value for key, value in term.items() if key != "roughness_map"} | images
