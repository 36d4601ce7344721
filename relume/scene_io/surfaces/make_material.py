"""Materials of surface parameters, made by the reader of glTF's materials."""

from __future__ import annotations

from typing import Any

import numpy as np
import PIL.Image
from jaxtyping import Shaped

from relume.core.import_warnings import ImporterWarning, approximated, quote
from relume.image_io.decode import U8
from relume.scene_io.gltf.document import GltfMaterial
from relume.scene_io.gltf.materials import MaterialReader, ReadMaterial
from relume.scene_io.surfaces.surface_images import CHANNELS, ImageInput, SurfaceImages, color_bytes, scalar_bytes
from relume.scene_io.surfaces.surface_inputs import Color, Rgb, Scalar
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters

_Channels = dict[str, ImageInput]


class SurfaceMaterials:
    """Makes the materials of one document, with unique names and a limit on their texels.

    Args:
        images: of the document. warnings: gets a sentence for each approximation.
    """

    def __init__(self, images: SurfaceImages, warnings: list[ImporterWarning]) -> None:
        self._packed = _PackedTextures(images)
        self._warnings = warnings
        self._reader = MaterialReader(self._packed, warnings)

    def make(self, name: str, surface: SurfaceParameters) -> ReadMaterial:
        """Make a material.

        Args:
            name: shown to users. surface: its parameters, whose images can be used.
        Raises:
            SceneError: there are too many texels.
        """
        pack = _Pack(self._packed, f"material {quote(name)}", self._warnings)
        return self._reader.read(_gltf_material(name, surface, pack))

    def warn_occlusion_maps(self) -> None:
        """Add one warning for the occlusion maps of all materials."""
        self._reader.warn_occlusion_maps()


class _PackedTextures:
    """Textures whose channels come from several images."""

    def __init__(self, images: SurfaceImages) -> None:
        self._images, self._textures = images, list[_Channels]()

    def add(self, channels: _Channels) -> int:
        self._textures.append(channels)
        return len(self._textures) - 1

    def is_usable(self, index: int, label: str) -> bool:
        """True: `SurfaceInputs` left out what cannot be read."""
        return True

    def texture(self, index: int, label: str) -> tuple[Shaped[U8, "height width 4"], tuple[str, str]]:
        """See `relume.scene_io.gltf.images.ImageReader.texture`."""
        channels = self._textures[index]
        layers = {key: self._layer(key, image, label) for key, image in channels.items()}
        height, width = (max(layer.shape[axis] for layer in layers.values()) for axis in (0, 1))
        packed = np.full((height, width, 4), 255, np.uint8)
        for key, layer in layers.items():
            for channel, values in zip(key.removesuffix(_RAW), np.moveaxis(layer, -1, 0), strict=True):
                packed[..., CHANNELS.index(channel)] = _resized(values, height, width)
        return packed, next(iter(channels.values())).wrap

    def _layer(self, key: str, image: ImageInput, label: str) -> Shaped[U8, "height width channels"]:
        pixels = self._images.pixels(image.file, label)
        assert pixels is not None
        if key == "rgb" + _RAW:
            return pixels[..., :3]
        return color_bytes(pixels, image) if key == "rgb" else scalar_bytes(pixels, image)[..., None]


_RAW = " raw"  # after "rgb": bytes of normals, not of colors


class _Pack:
    """The textures of one material, as members of a glTF document."""

    def __init__(self, packed: _PackedTextures, label: str, warnings: list[ImporterWarning]) -> None:
        self._packed, self._label, self._warnings = packed, label, warnings

    def texture(self, member: str, values: dict[str, Any]) -> dict[str, Any]:
        """The texture of the values that are images, by channel; no member if there is none."""
        channels = {channel: value for channel, value in values.items() if isinstance(value, ImageInput)}
        if not channels:
            return {}
        first = next(iter(channels.values()))
        if any((image.transform, image.wrap) != (first.transform, first.wrap) for image in channels.values()):
            message = f"Images of {self._label} that are used together repeat differently; all repeat as the first."
            self._warnings.append(approximated(message))
        transform = {"KHR_texture_transform": first.transform.model_dump()}
        return {member: {"index": self._packed.add(channels), "extensions": transform}}

    def factor(self, value: Scalar) -> float:
        """The factor of a number."""
        return self.color_factor(value)[0]

    def color_factor(self, value: Scalar | Color) -> Rgb:
        """The factor of a number or a color, in [0, 1]."""
        factors = np.broadcast_to(value.factor if isinstance(value, ImageInput) else value, 3)
        if (factors < 0).any() or (factors > 1).any():
            self._warnings.append(approximated(f"A factor of an image of {self._label} was clamped to [0, 1]."))
        red, green, blue = np.clip(factors, 0, 1).tolist()
        return red, green, blue


def _resized(values: Shaped[U8, "height width"], height: int, width: int) -> Shaped[U8, "height width"]:
    if values.shape == (height, width):
        return values
    image = PIL.Image.fromarray(np.ascontiguousarray(values))
    return np.asarray(image.resize((width, height), PIL.Image.Resampling.BILINEAR))


def _gltf_material(name: str, surface: SurfaceParameters, pack: _Pack) -> GltfMaterial:
    base = {"rgb": surface.base_color} | ({"a": surface.alpha} if surface.alpha_mode != "OPAQUE" else {})
    alpha = pack.factor(surface.alpha) if surface.alpha_mode != "OPAQUE" else 1.0
    emits = surface.emission_strength > 0
    normal = surface.normal
    normal_texture = pack.texture("normalTexture", {"rgb" + _RAW: normal})
    if normal is not None:
        normal_texture["normalTexture"]["scale"] = normal.factor[0]
    return GltfMaterial.model_validate(
        {
            "name": name,
            "pbrMetallicRoughness": {
                "baseColorFactor": [*pack.color_factor(surface.base_color), alpha],
                "metallicFactor": pack.factor(surface.metallic),
                "roughnessFactor": pack.factor(surface.roughness),
                **pack.texture("baseColorTexture", base),
                **pack.texture("metallicRoughnessTexture", {"g": surface.roughness, "b": surface.metallic}),
            },
            **normal_texture,
            **({"occlusionTexture": {"index": 0}} if surface.has_occlusion else {}),
            "emissiveFactor": _values(surface.emission) if emits else [0.0, 0.0, 0.0],
            **(pack.texture("emissiveTexture", {"rgb": surface.emission}) if emits else {}),
            "alphaMode": surface.alpha_mode,
            "alphaCutoff": surface.alpha_cutoff,
            "doubleSided": True,
            "extensions": _extensions(surface, pack),
        }
    )


def _extensions(surface: SurfaceParameters, pack: _Pack) -> dict[str, Any]:
    """The extensions; those that change nothing are left out, since unsupported ones are a warning."""
    extensions: dict[str, dict[str, Any]] = {
        "ior": {"ior": surface.ior},
        "specular": {
            "specularFactor": pack.factor(surface.specular),
            **pack.texture("specularTexture", {"a": surface.specular}),
            "specularColorFactor": _values(surface.specular_color),
            **pack.texture("specularColorTexture", {"rgb": surface.specular_color}),
        },
        "clearcoat": {
            "clearcoatFactor": pack.factor(surface.clearcoat),
            **pack.texture("clearcoatTexture", {"r": surface.clearcoat}),
            "clearcoatRoughnessFactor": pack.factor(surface.clearcoat_roughness),
            **pack.texture("clearcoatRoughnessTexture", {"g": surface.clearcoat_roughness}),
        },
        "sheen": {
            "sheenColorFactor": [*pack.color_factor(surface.sheen_color)],
            **pack.texture("sheenColorTexture", {"rgb": surface.sheen_color}),
            "sheenRoughnessFactor": pack.factor(surface.sheen_roughness),
            **pack.texture("sheenRoughnessTexture", {"a": surface.sheen_roughness}),
        },
        "anisotropy": {
            "anisotropyStrength": surface.anisotropy,
            "anisotropyRotation": surface.anisotropy_rotation,
        },
        "emissive_strength": {"emissiveStrength": surface.emission_strength},
        "transmission": {
            "transmissionFactor": pack.factor(surface.transmission),
            **pack.texture("transmissionTexture", {"r": surface.transmission}),
        },
        "volume": {
            "thicknessFactor": surface.thickness,
            "attenuationDistance": surface.attenuation_distance,
            "attenuationColor": [*surface.attenuation_color],
        },
        **({"iridescence": {"iridescenceFactor": surface.iridescence}} if surface.iridescence > 0 else {}),
        **({"dispersion": {"dispersion": surface.dispersion}} if surface.dispersion > 0 else {}),
    }
    return {f"KHR_materials_{name}": extension for name, extension in extensions.items()}


def _values(color: Color) -> list[float]:
    return [*(color.factor if isinstance(color, ImageInput) else color)]
