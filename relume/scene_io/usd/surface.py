"""The inputs that shaders of USD have in common, and their conversion to a glTF material.

UsdPreviewSurface, standard_surface and OpenPBR share the model of glTF: a metallic-roughness base below a coat. The
glTF reader therefore makes the terms of all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene_io.gltf.document import GltfMaterial, MetallicRoughness, TextureInfo
from relume.scene_io.gltf.uvs import UvTransform
from relume.scene_io.usd.images import ImageChannel, Meaning, TextureRecipe, UsdImages
from relume.scene_io.usd.networks import Numbers, PrimvarReference, Sample, Value
from relume.scene_io.usd.polygon_mesh import COLOR

F64 = NDArray[np.float64]
WHITE = ImageChannel(None)
MAX_UV_SETS = 64
MAX_EMISSION = 1e6
RGB = (0, 1, 2)


@dataclass(frozen=True)
class Surface:
    """A shader's inputs; images, numbers, or primvars.

    Attributes:
        specular_color: reflectance at normal incidence instead of that of `ior`; None for that of `ior`.
        opacity_threshold: surfaces below it are cut; 0 for blending.
        is_solid: what transmits is the boundary of a solid, not a thin pane. attenuation_distance: meters.
        transparency: fraction of the light that passes without a change of color, as UsdPreviewSurface's opacity.
    """

    base_color: Value = (0.18, 0.18, 0.18)
    metallic: Value = (0.0,)
    roughness: Value = (0.5,)
    opacity: Value = (1.0,)
    opacity_threshold: float = 0.0
    normal: Value = None
    occlusion: Value = None
    emission: Value = (0.0, 0.0, 0.0)
    emission_scale: float = 1.0
    ior: float = 1.5
    specular_weight: float = 1.0
    specular_color: Value = None
    specular_tint: Numbers = (1.0, 1.0, 1.0)
    coat: Value = (0.0,)
    coat_roughness: Value = (0.0,)
    sheen_color: Numbers = (0.0, 0.0, 0.0)
    sheen_roughness: float = 0.3
    anisotropy: float = 0.0
    anisotropy_rotation: float = 0.0
    transmission: float = 0.0
    is_solid: bool = False
    attenuation_color: Numbers = (1.0, 1.0, 1.0)
    attenuation_distance: float = float("inf")
    transparency: float = 0.0

    @property
    def uses_display_color(self) -> bool:
        """True if the base color is the primvar of that name."""
        return isinstance(self.base_color, PrimvarReference) and self.base_color.name == COLOR


class SurfaceConverter:
    """Converts one surface.

    Attributes:
        uv_names: primvars with texture coordinates; textures name them by number.
    """

    def __init__(self, images: UsdImages, label: str, warnings: list[ImporterWarning]) -> None:
        self._images, self._label, self._warnings = images, label, warnings
        self.uv_names: list[str] = []

    def convert(self, surface: Surface, name: str, thickness: float, *, double_sided: bool) -> GltfMaterial:
        """Return the material in the model of glTF.

        Args:
            surface: inputs of the shader. name: of the material. thickness: of its solids, meters.
            double_sided: whether both sides emit.
        """
        emission, emission_factor = self._channels(surface.emission, (0.0, 0.0, 0.0), "emission")
        occlusion, _ = self._channels(surface.occlusion, (1.0,), "occlusion")
        pbr, has_alpha = self._metallic_roughness(surface)
        is_cut = surface.opacity_threshold > 0
        return GltfMaterial(
            name=name,
            pbrMetallicRoughness=pbr,
            normalTexture=self._normal(surface.normal),
            occlusionTexture=self._texture((*occlusion, WHITE, WHITE, WHITE), "data"),
            emissiveTexture=self._texture((*emission, WHITE), "color"),
            emissiveFactor=np.clip(emission_factor * surface.emission_scale, 0, MAX_EMISSION).tolist(),
            alphaMode="MASK" if is_cut else "BLEND" if has_alpha else "OPAQUE",
            alphaCutoff=surface.opacity_threshold if is_cut else 0.5,
            doubleSided=double_sided,
            extensions={f"KHR_materials_{key}": value for key, value in self._extensions(surface, thickness).items()},
        )

    def _metallic_roughness(self, surface: Surface) -> tuple[MetallicRoughness, bool]:
        """The base layer, and whether its alpha is below 1."""
        base, base_factor = self._channels(surface.base_color, (0.18, 0.18, 0.18), "base color")
        opacity, opacity_factor = self._channels(surface.opacity, (1.0,), "opacity")
        roughness, roughness_factor = self._channels(surface.roughness, (0.5,), "roughness")
        metallic, metallic_factor = self._channels(surface.metallic, (0.0,), "metallic")
        pbr = MetallicRoughness(
            baseColorFactor=_clip([*(base_factor * (1 - surface.transparency)), *opacity_factor]),
            baseColorTexture=self._texture((*base, *opacity), "color"),
            metallicFactor=_clip(metallic_factor)[0],
            roughnessFactor=_clip(roughness_factor)[0],
            metallicRoughnessTexture=self._texture((WHITE, *roughness, *metallic, WHITE), "data"),
        )
        return pbr, opacity[0] is not WHITE or opacity_factor[0] < 1

    def _extensions(self, surface: Surface, thickness: float) -> dict[str, Any]:
        coat, coat_factor = self._channels(surface.coat, (0.0,), "coat")
        coat_roughness, coat_roughness_factor = self._channels(surface.coat_roughness, (0.0,), "coat roughness")
        return {
            "ior": {"ior": surface.ior},
            "specular": self._specular(surface),
            "clearcoat": {
                "clearcoatFactor": _clip(coat_factor)[0],
                "clearcoatTexture": self._texture((*coat, WHITE, WHITE, WHITE), "data"),
                "clearcoatRoughnessFactor": _clip(coat_roughness_factor)[0],
                "clearcoatRoughnessTexture": self._texture((WHITE, *coat_roughness, WHITE, WHITE), "data"),
            },
            "sheen": {
                "sheenColorFactor": _clip(surface.sheen_color),
                "sheenRoughnessFactor": _clip([surface.sheen_roughness])[0],
            },
            "anisotropy": {
                "anisotropyStrength": _clip([surface.anisotropy])[0],
                "anisotropyRotation": surface.anisotropy_rotation,
            },
            "transmission": {"transmissionFactor": _clip([surface.transmission])[0]},
            "volume": {
                "thicknessFactor": thickness if surface.is_solid else 0.0,
                "attenuationColor": _clip(surface.attenuation_color),
                "attenuationDistance": surface.attenuation_distance,
            },
        }

    def _specular(self, surface: Surface) -> dict[str, Any]:
        """KHR_materials_specular; a specular color of the shader divides by the reflectance of the index."""
        color, factor = self._channels(surface.specular_color, (0.0, 0.0, 0.0), "specular color")
        tint = np.array(surface.specular_tint)
        if surface.specular_color is not None:
            tint = factor / max(((surface.ior - 1) / (surface.ior + 1)) ** 2, 1e-6)
        return {
            "specularFactor": _clip([surface.specular_weight])[0],
            "specularColorFactor": np.clip(tint, 0, 1e6).tolist(),
            "specularColorTexture": self._texture((*color, WHITE), "color"),
        }

    def _normal(self, value: Value) -> TextureInfo | None:
        """The normal map; a constant normal is that of the surface."""
        if (
            not isinstance(value, Sample)
            or self._images.load(value.asset, f"the normal texture of {self._label}") is None
        ):
            return None
        x, y, z = (ImageChannel(value, number) for number in RGB)
        return self._texture((x, y, z, WHITE), "normal")

    def _channels(self, value: Value, default: Numbers, name: str) -> tuple[tuple[ImageChannel, ...], F64]:
        """Channels of an image, white without one, and the factor of each."""
        white = (WHITE,) * len(default)
        if isinstance(value, PrimvarReference):
            if value.name == COLOR and len(default) == 3:
                return white, np.ones(3)  # the mesh has them
            self._warnings.append(
                unsupported(f"The {name} of {self._label} is a primvar {quote(value.name)}, which isn't supported.")
            )
            value = value.fallback
        if isinstance(value, Sample):
            if self._images.load(value.asset, f"the {name} texture of {self._label}") is not None:
                return _split_factor(value, len(default))
            value = value.fallback
        if not isinstance(value, tuple):
            return white, np.array(default)
        return white, np.array(value[:3] if len(default) == 3 and len(value) >= 3 else value[:1] * len(default))

    def _texture(self, channels: tuple[ImageChannel, ...], meaning: Meaning) -> TextureInfo | None:
        """A texture; None if it is white. The first image decides on the texture coordinates."""
        red, green, blue, alpha = channels
        recipe = TextureRecipe((red, green, blue, alpha), meaning)
        if not recipe.samples:
            return None
        first, *others = recipe.samples
        if any((s.uv_name, s.transform, s.wrap) != (first.uv_name, first.transform, first.wrap) for s in others):
            message = (
                f"Images of {self._label} that are combined have different texture coordinates; all use the first's."
            )
            self._warnings.append(unsupported(message))
        if first.uv_name not in self.uv_names:
            self.uv_names.append(first.uv_name)
        transform = {"KHR_texture_transform": first.transform.model_dump(exclude_none=True)}
        return TextureInfo(
            index=self._images.add(recipe),
            texCoord=min(self.uv_names.index(first.uv_name), MAX_UV_SETS - 1),
            extensions={} if first.transform == UvTransform() else transform,
        )


def _split_factor(sample: Sample, width: int) -> tuple[tuple[ImageChannel, ...], F64]:
    """Channels of a sample for one number or a color; a scale in [0, 1] without bias is the factor."""
    numbers = sample.channels[:1] * width if len(sample.channels) < width else sample.channels[:width]
    scale, bias = (np.array([row[number] for number in numbers]) for row in (sample.scale, sample.bias))
    if bias.any() or (scale < 0).any() or (scale > 1).any():
        return tuple(ImageChannel(sample, number) for number in numbers), np.ones(width)
    plain = replace(sample, scale=(1.0,) * 4, bias=(0.0,) * 4)
    return tuple(ImageChannel(plain, number) for number in numbers), scale


def _clip(values: Any) -> list[float]:
    return [float(value) for value in np.clip(values, 0, 1)]
