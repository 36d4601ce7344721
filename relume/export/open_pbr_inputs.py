"""Principled surfaces as inputs of OpenPBR Surface 1.1: the inverse of `relume.scene_io.surfaces.open_pbr`."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, isfinite, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.fresnel import normal_reflectance
from relume.core.import_warnings import quote
from relume.export.base_layer import index_of_refraction
from relume.export.export_images import ExportImages
from relume.export.export_materials import ExportMaterial
from relume.export.surface_values import microfacet_widths
from relume.math.uv_transform import UvTransform
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Color, Value, scaled
from relume.scene_io.surfaces.surface_parameters import BLACK, WHITE, SurfaceParameters

Inputs = dict[str, Value]
_COAT_IOR = 1.5  # of glTF, and of the term
IMAGE_FOLDER = "textures"
ADDRESS_MODES = {"repeat": "periodic", "mirror": "mirror", "clamp": "clamp"}
"""Wrap modes of MaterialX."""


def open_pbr_inputs(material: ExportMaterial, images: ExportImages) -> Inputs:
    """Return the inputs that differ from the defaults, by name; normals as `geometry_normal`.

    Args:
        material: of an export. images: gets the image of an alpha test.
    """
    surface = material.surface
    roughness, anisotropy = _specular_roughness(surface)
    inputs: Inputs = {
        "base_color": surface.base_color,
        "base_metalness": surface.metallic,
        "specular_weight": surface.specular,
        "specular_roughness": roughness,
        **_reflectance(surface),
    }
    if anisotropy > 0:
        inputs["specular_roughness_anisotropy"] = anisotropy
    if surface.clearcoat != 0:
        coat = {"coat_weight": surface.clearcoat, "coat_roughness": surface.clearcoat_roughness}
        inputs |= {**coat, "coat_ior": _COAT_IOR, "coat_darkening": 0.0}
    if surface.sheen_color != BLACK:
        fuzz = {"fuzz_color": surface.sheen_color, "fuzz_roughness": surface.sheen_roughness}
        inputs |= {"fuzz_weight": 1.0, **fuzz}
    if surface.transmission != 0:
        inputs |= _transmission(surface)
    if surface.emission != BLACK:
        inputs |= {"emission_color": surface.emission, "emission_luminance": surface.emission_strength}
    if surface.alpha_mode != "OPAQUE":
        inputs["geometry_opacity"] = _opacity(material, images)
    if surface.normal is not None:
        inputs["geometry_normal"] = surface.normal
    return inputs


def place2d_inputs(uv: UvTransform) -> dict[str, Any]:
    """Return the inputs of a node `place2d`, which scales by reciprocals and subtracts its offset."""
    u, v = uv.translation_from_bottom
    return {
        "scale": (1 / uv.scale[0], 1 / uv.scale[1]),
        "rotate": -degrees(uv.rotation),
        "offset": (-u, -v),
    }


def omitted_from_open_pbr(material: ExportMaterial) -> tuple[str, ...]:
    """Sentences about features that OpenPBR does not have."""
    surface, label = material.surface, f"material {quote(material.name)}"
    is_solid = surface.transmission != 0 and surface.thickness > 0
    sentences = {
        f"The thickness of {label} is not part of OpenPBR.": is_solid,
        f"The tint of the surface of {label} is not part of OpenPBR; that of its inside is.": is_solid
        and isfinite(surface.attenuation_distance)
        and surface.base_color != WHITE,
    }
    return tuple(sentence for sentence, applies in sentences.items() if applies)


def _specular_roughness(surface: SurfaceParameters) -> tuple[float | ImageInput, float]:
    """Roughness and anisotropy a: α along = r² √(2 / (1 + (1 − a)²)), α across = (1 − a) α along."""
    if surface.anisotropy == 0 or isinstance(surface.roughness, ImageInput):
        return surface.roughness, 0.0
    along, across = microfacet_widths(surface.roughness, surface.anisotropy, 0.0)
    ratio = across / along
    return sqrt(along / sqrt(2 / (1 + ratio**2))), 1 - ratio


def _reflectance(surface: SurfaceParameters) -> Inputs:
    """Specular color, at most 1, and the index of refraction that gives its brightest channel."""
    color = surface.specular_color
    highest = max(color.factor if isinstance(color, ImageInput) else color)
    if highest <= 1:
        return {"specular_color": color, "specular_ior": surface.ior}
    reflectance = min(normal_reflectance(surface.ior) * highest, 0.99)
    limited: Color = scaled(color, (1 / highest,) * 3)
    return {"specular_color": limited, "specular_ior": index_of_refraction(reflectance)}


def _transmission(surface: SurfaceParameters) -> Inputs:
    inputs: Inputs = {"transmission_weight": surface.transmission}
    if surface.thickness == 0:
        inputs["geometry_thin_walled"] = 1.0
    if not isfinite(surface.attenuation_distance):
        return inputs | {"transmission_color": surface.base_color}
    depth: Inputs = {
        "transmission_depth": surface.attenuation_distance,
        "transmission_color": surface.attenuation_color,
    }
    return inputs | depth


def _opacity(material: ExportMaterial, images: ExportImages) -> float | ImageInput:
    """Opacity; 0 or 1 for an alpha test, which OpenPBR does not have."""
    alpha, cutoff = material.surface.alpha, material.surface.alpha_cutoff
    if material.surface.alpha_mode != "MASK":
        return alpha
    if not isinstance(alpha, ImageInput):
        return float(alpha >= cutoff)

    def make_pixels() -> NDArray[np.uint8]:
        return np.where(images.pixels(alpha.file) >= 255 * cutoff, 255, 0).astype(np.uint8)

    return replace(alpha, file=images.add(f"{material.name} cutout", ("cutout", alpha.file, cutoff), make_pixels))
