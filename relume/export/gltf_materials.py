"""Principled surfaces as materials of glTF 2.0 with its extensions; parameters with their defaults are left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.export.export_images import ExportImages, resized
from relume.export.export_materials import ExportMaterial
from relume.math.uv_transform import UvTransform
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Color, Scalar
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters

U8 = NDArray[np.uint8]
AddTexture = Callable[[ImageInput], int]
_DEFAULT = SurfaceParameters()
TEXTURE_TRANSFORM = "KHR_texture_transform"


class GltfMaterials:
    """Writes materials. images: of the export. add_texture: returns the index of an image in the file."""

    def __init__(self, images: ExportImages, add_texture: AddTexture) -> None:
        self._images, self._add_texture = images, add_texture

    def document(self, material: ExportMaterial) -> dict[str, Any]:
        """Return a material of glTF; its error and what it omits are in `extras.relume`."""
        surface = material.surface
        base, packed = self._with_alpha(material.name, surface), self._packed(material.name, surface)
        roughness_texture = self._texture("metallicRoughnessTexture", packed)
        alpha = 1.0 if isinstance(surface.alpha, ImageInput) else surface.alpha
        extensions = self._extensions(surface)
        return {
            "name": material.name,
            "pbrMetallicRoughness": {
                "baseColorFactor": [*_factors(surface.base_color), alpha],
                "metallicFactor": _factors(surface.metallic)[0],
                "roughnessFactor": _factors(surface.roughness)[0],
                **self._texture("baseColorTexture", base),
                **roughness_texture,
            },
            **self._texture("normalTexture", surface.normal),
            **({"emissiveFactor": _factors(surface.emission)} if surface.emission != _DEFAULT.emission else {}),
            **self._texture("emissiveTexture", surface.emission),
            **({} if surface.alpha_mode == "OPAQUE" else {"alphaMode": surface.alpha_mode}),
            **({"alphaCutoff": surface.alpha_cutoff} if surface.alpha_mode == "MASK" else {}),
            "doubleSided": material.is_double_sided,
            **({"extensions": extensions} if extensions else {}),
            "extras": {"relume": {"error": round(material.error, 4), "omitted": [*material.omitted]}},
        }

    def _texture(self, member: str, value: Scalar | Color | None) -> dict[str, Any]:
        """A texture, if the value is an image."""
        if not isinstance(value, ImageInput):
            return {}
        scale = {"scale": value.factor[0]} if member == "normalTexture" and value.factor[0] != 1 else {}
        return {member: {"index": self._add_texture(value), **scale, **_transform(value.transform)}}

    def _with_alpha(self, name: str, surface: SurfaceParameters) -> Scalar | Color:
        """The base color, with the opacity as its alpha if that is an image."""
        base, alpha = surface.base_color, surface.alpha
        if not isinstance(alpha, ImageInput):
            return base
        colors, opacity = base.file if isinstance(base, ImageInput) else None, alpha.file

        def make_pixels() -> U8:
            return self._joined([*[(colors, k) for k in range(3)], (opacity, 0)])

        file = self._images.add(f"{name} base color", ("rgba", colors, opacity), make_pixels)
        return replace(base, file=file) if isinstance(base, ImageInput) else replace(alpha, file=file)

    def _packed(self, name: str, surface: SurfaceParameters) -> ImageInput | None:
        """Roughness as green and metalness as blue; None if both are uniform."""
        inputs = surface.roughness, surface.metallic
        roughness, metallic = (value.file if isinstance(value, ImageInput) else None for value in inputs)
        first = next((value for value in inputs if isinstance(value, ImageInput)), None)
        if first is None:
            return None

        def make_pixels() -> U8:
            return self._joined([(None, 0), (roughness, 0), (metallic, 0)])

        key = "packed", roughness, metallic
        return replace(first, file=self._images.add(f"{name} metallic roughness", key, make_pixels))

    def _joined(self, channels: list[tuple[str | None, int]]) -> Shaped[U8, "height width channels"]:
        """Join channels of images; white without a file."""
        loaded = {file: self._images.pixels(file) for file, _ in channels if file is not None}
        size = tuple(max(pixels.shape[axis] for pixels in loaded.values()) for axis in (0, 1))
        images = {file: resized(pixels, size) for file, pixels in loaded.items()}
        white = np.full(size, 255, np.uint8)
        planes = [
            white if file is None else images[file][..., min(channel, images[file].shape[2] - 1)]
            for file, channel in channels
        ]
        return np.stack(planes, axis=-1)

    def _extensions(self, surface: SurfaceParameters) -> dict[str, Any]:
        extensions = {
            "emissive_strength": {"emissiveStrength": surface.emission_strength},
            "clearcoat": {
                "clearcoatFactor": surface.clearcoat,
                "clearcoatRoughnessFactor": surface.clearcoat_roughness,
            },
            "sheen": {
                "sheenColorFactor": _factors(surface.sheen_color),
                "sheenRoughnessFactor": surface.sheen_roughness,
            },
            "anisotropy": {
                "anisotropyStrength": surface.anisotropy,
                "anisotropyRotation": surface.anisotropy_rotation,
            },
            "transmission": {"transmissionFactor": surface.transmission},
            "volume": _volume(surface),
            "ior": {"ior": surface.ior},
            "specular": {
                "specularFactor": surface.specular,
                "specularColorFactor": _factors(surface.specular_color),
                **self._texture("specularColorTexture", surface.specular_color),
            },
        }
        has_effect = {
            "emissive_strength": surface.emission_strength != 1,
            "clearcoat": surface.clearcoat != 0,
            "sheen": surface.sheen_color != _DEFAULT.sheen_color,
            "anisotropy": surface.anisotropy != 0,
            "transmission": surface.transmission != 0,
            "volume": surface.thickness != 0,
            "ior": surface.ior != _DEFAULT.ior,
            "specular": surface.specular != 1 or surface.specular_color != _DEFAULT.specular_color,
        }
        return {f"KHR_materials_{name}": extensions[name] for name, applies in has_effect.items() if applies}


def _transform(uv: UvTransform) -> dict[str, Any]:
    """The extension of a texture whose coordinates are transformed."""
    if uv == UvTransform():
        return {}
    members = {"offset": [*uv.offset], "rotation": uv.rotation, "scale": [*uv.scale]}
    return {"extensions": {TEXTURE_TRANSFORM: members}}


def _volume(surface: SurfaceParameters) -> dict[str, Any]:
    volume: dict[str, Any] = {"thicknessFactor": surface.thickness}
    if isfinite(surface.attenuation_distance):
        volume["attenuationDistance"] = surface.attenuation_distance
        volume["attenuationColor"] = [*surface.attenuation_color]
    return volume


def _factors(value: Scalar | Color) -> list[float]:
    """Three factors of a number, a color or an image."""
    red, green, blue = np.broadcast_to(value.factor if isinstance(value, ImageInput) else value, 3).tolist()
    return [red, green, blue]
