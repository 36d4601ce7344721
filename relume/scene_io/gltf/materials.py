"""Materials of a glTF file: factors and textures of the base layer, which `to_terms` converts.

With base color b, metallic m and specular s with color c: lambert has b (1 - m), the highlight has
f0 = mix(s min(c f, 1), b, m) and f90 = mix(s, 1, m), with f from the index of refraction. glTF 2.0 specification,
appendix B, and the specifications of the extensions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored, quote, unsupported
from relume.scene.model import Glass, Material, Opacity, Texture, TextureEncoding
from relume.scene.opacity import make_opacity
from relume.scene.texture_encoding import mean_value
from relume.scene.textured_vertex_colors import TexturedColors
from relume.scene.unique_names import unique_name
from relume.scene.validate import MAX_IOR
from relume.scene_io.gltf.blend import MetallicBlend, lerp
from relume.scene_io.gltf.document import GltfMaterial as GltfMaterial
from relume.scene_io.gltf.document import TextureInfo
from relume.scene_io.gltf.images import U8
from relume.scene_io.gltf.material_extensions import Clearcoat, MaterialExtensions, read_extensions
from relume.scene_io.gltf.texture_resampling import Raster
from relume.scene_io.gltf.to_terms import CoatLayer, PbrSurface, dielectric_reflectance, make_terms
from relume.scene_io.gltf.uvs import UvSlot, UvTransforms

MAX_TEXTURE_TEXELS = 700_000_000  # of all materials of a scene, 3 bytes each


@dataclass(frozen=True)
class VertexColors:
    """Vertex colors of a material.

    Attributes:
        factor: RGB and alpha that multiply the base color.
        textured: multiplies the base color texture, if there is one; None if the colors are uniform.
    """

    factor: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    textured: TexturedColors | None = None


class TextureLayout(NamedTuple):
    """Texture coordinates of a material: their slot, height and width of its largest image, and its wrap modes."""

    slot: UvSlot
    size: tuple[int, int]
    wrap: tuple[str, str]


@dataclass(frozen=True)
class ReadMaterial:
    """A material, with the UV coordinates that its meshes need.

    Attributes:
        tangent_rotation: radians, from the tangent toward the bitangent; None for an isotropic material.
        emission: radiance, multiplied by the texture of that name.
    """

    material: Material
    uv_slot: UvSlot
    tangent_rotation: float | None = None
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)


WHITE = VertexColors()


class TextureSource(Protocol):
    """Textures by the index that a `TextureInfo` has."""

    def texture(self, index: int, label: str) -> tuple[Shaped[U8, "height width 4"], tuple[str, str]]:
        """Return the RGBA bytes of a texture and its wrap modes along u and v; see `ImageReader.texture`."""


class MaterialReader:
    """Converts the materials of one file, with a limit on their texels."""

    def __init__(self, images: TextureSource, warnings: list[ImporterWarning]) -> None:
        self._images = images
        self._warnings = warnings
        self._names: dict[str, int] = {}
        self._remaining_texels = MAX_TEXTURE_TEXELS
        self._occluded_materials: list[str] = []
        self._colors: TexturedColors | None = None  # of the material that is read

    def read(self, material: GltfMaterial, colors: VertexColors = WHITE) -> ReadMaterial:
        """Convert one material, with a unique name.

        Args:
            material: from the document. colors: vertex colors of its meshes.
        Raises:
            SceneError: a texture is unusable or there are too many texels.
        """
        name = unique_name(material.name or "material", self._names)
        label = f"material {quote(name)}"
        extensions = read_extensions(material.extensions, label, self._warnings)
        self._warn_unsupported(material, label)
        infos = [info for info in _infos(material, extensions) if info is not None]
        self._uv_transforms = UvTransforms(infos, label, self._warnings)
        self._colors = colors.textured
        material = _scale_base_color(material, colors.factor)
        surface = self._surface(material, extensions, self._raster(material, extensions, label))
        strength, tangent_rotation = self._anisotropy(extensions, label)
        transmission = self._transmission(extensions, label)
        glass = self._glass(surface, extensions, transmission, label) if transmission > 0 else None
        if glass is None:
            self._warn_unphysical_ior(extensions, label)
        surface = replace(surface, diffuse=surface.diffuse * (1 - transmission))
        if strength > 0 and "roughness" in surface.textures:
            message = f"The roughness texture of {label} was replaced by its average because it is anisotropic."
            self._warnings.append(approximated(message))
        coat_layer = self._coat_layer(extensions, strength, label)
        normal_map = self._normal_map(material.normalTexture, tangent_rotation, label)
        emission_textures = self._emission_textures(material, label)
        if coat_layer.coat > 0:
            self._warn_coat_normals(extensions.clearcoat, label, has_normal_map=normal_map is not None)
        scene_material = Material(
            name,
            make_terms(replace(surface, has_normal_map=normal_map is not None), coat_layer),
            surface.textures | emission_textures,
            normal_map,
            material.doubleSided,
            opacity=self._opacity(material, label),
            glass=glass,
        )
        anisotropy_rotation = tangent_rotation if strength > 0 else None
        has_own_uvs = self._colors is not None and self._colors.corner_uvs is not None
        slot = UvSlot() if has_own_uvs else self._uv_transforms.slot
        return ReadMaterial(scene_material, slot, anisotropy_rotation, self._emission(material, extensions, label))

    def texture_layout(self, material: GltfMaterial) -> TextureLayout | None:
        """Find where the textures of a material are; None if it has none that are used as images."""
        label = f"material {quote(material.name or 'material')}"
        extensions = read_extensions(material.extensions, label, [])
        infos = [info for info in _infos(material, extensions) if info is not None]
        if not infos:
            return None
        transforms = UvTransforms(infos, label, [])
        loaded = [(info, *self._images.texture(info.index, f"a texture of {label}")) for info in infos]
        shapes = [transforms.tile_image(info, pixels, wrap).shape for info, pixels, wrap in loaded]
        size = max(height for height, *_ in shapes), max(width for _, width, *_ in shapes)
        return TextureLayout(transforms.slot, size, loaded[0][2])

    def _transmission(self, extensions: MaterialExtensions, label: str) -> float:
        transmission = extensions.transmission
        return transmission.transmissionFactor * self._mean(
            transmission.transmissionTexture, 0, f"transmission texture of {label}"
        )

    def _glass(self, surface: PbrSurface, extensions: MaterialExtensions, transmission: float, label: str) -> Glass:
        """Thin or solid glass: tinted by the base color, and absorbing inside a solid."""
        volume, ior = extensions.volume, extensions.ior.ior
        if not 1 <= ior <= MAX_IOR:
            message = f"The index of refraction {ior:g} of {label} is out of range; 1.5 is used."
            self._warnings.append(unsupported(message))
            ior = 1.5
        tint = surface.diffuse * transmission
        if "diffuse" in surface.textures:
            tint = tint * mean_value(surface.textures["diffuse"])
        absorbed = -np.log(np.maximum(volume.attenuationColor, 1e-6)) / volume.attenuationDistance
        red, green, blue = np.clip(tint, 0, 1).tolist()
        r, g, b = absorbed.tolist() if volume.thicknessFactor > 0 else (0.0, 0.0, 0.0)
        return Glass((red, green, blue), ior, volume.thicknessFactor, (r, g, b), surface.roughness)

    def _warn_coat_normals(self, coat: Clearcoat, label: str, *, has_normal_map: bool) -> None:
        """Warn if the coat has other normals than the base layer; a view sample has one normal for both."""
        has_coat_normals = coat.clearcoatNormalTexture is not None
        if has_normal_map or has_coat_normals:
            appearance = "follows the base normal map" if has_normal_map else "is smooth"
            original = "it has its own normal map" if has_coat_normals else "it is smooth"
            self._warnings.append(approximated(f"Clearcoat on {label} {appearance}; in the file {original}."))

    def _warn_unphysical_ior(self, extensions: MaterialExtensions, label: str) -> None:
        """Warn about an index of refraction that no opaque material has, unless it means a mirror."""
        ior, specular = extensions.ior.ior, extensions.specular
        reflectance = min(1.0, _f0(ior) * max(specular.specularColorFactor)) * specular.specularFactor
        if 0 < ior < 1 or reflectance > _f0(MAX_IOR):
            message = f"Unusual index of refraction {ior:g} on {label} (default 1.5): non-metallic parts reflect"
            self._warnings.append(unsupported(f"{message} {reflectance:.0%} of the light at normal incidence."))

    def _opacity(self, material: GltfMaterial, label: str) -> Opacity | None:
        """Opacity of a material; alpha is ignored in other alpha modes."""
        if material.alphaMode not in ("MASK", "BLEND"):
            if material.alphaMode != "OPAQUE":
                message = f"The alpha mode {quote(material.alphaMode)} of {label} isn't supported; it is shown opaque."
                self._warnings.append(unsupported(message))
            return None
        pbr, alpha, wrap = material.pbrMetallicRoughness, None, ("repeat", "repeat")
        if (base := self._base_image(material, label)) is not None:
            alpha, wrap = base[0][..., 3], base[1]
        cutoff = material.alphaCutoff if material.alphaMode == "MASK" else None
        return make_opacity(alpha, wrap, pbr.baseColorFactor[3], cutoff, label, self._warnings)

    def _emission(
        self, material: GltfMaterial, extensions: MaterialExtensions, label: str
    ) -> tuple[float, float, float]:
        factor = np.maximum(material.emissiveFactor, 0) * extensions.emissive_strength.emissiveStrength
        red, green, blue = factor.tolist()
        return red, green, blue

    def _emission_textures(self, material: GltfMaterial, label: str) -> dict[str, Texture]:
        """The emission texture as it is in the file."""
        if material.emissiveTexture is None or max(material.emissiveFactor) <= 0:
            return {}
        pixels, wrap = self._load_image(material.emissiveTexture, f"the emission texture of {label}")
        return {
            "emission": self._count_texels(
                Texture(np.ascontiguousarray(pixels[..., :3]), wrap, TextureEncoding("srgb"))
            )
        }

    def _surface(self, material: GltfMaterial, extensions: MaterialExtensions, raster: Raster) -> PbrSurface:
        """The base layer, with textures only if their values vary."""
        pbr, specular = material.pbrMetallicRoughness, extensions.specular
        factor = np.array(pbr.baseColorFactor[:3])
        dielectric = _f0(extensions.ior.ior) * np.array(specular.specularColorFactor)
        roughness = raster.mean("packed", 1) * pbr.roughnessFactor
        specular_reflectance = dielectric_reflectance(
            float(np.minimum(dielectric, 1).max()) * specular.specularFactor, specular.specularFactor
        )
        if raster.empty:
            metallic, weight = pbr.metallicFactor, specular.specularFactor
            f0 = lerp(weight * np.minimum(dielectric, 1), factor, metallic)
            return PbrSurface(factor * (1 - metallic), f0, lerp(weight, 1, metallic), roughness, specular_reflectance)
        blend = MetallicBlend(raster, factor, dielectric, pbr.metallicFactor, specular.specularFactor)
        textures = {"diffuse": self._count_texels(blend.diffuse())}
        if roughness > 0 and raster.varies("packed", 1):
            textures["roughness"] = self._count_texels(_normalize_roughness(raster))
        lowest, highest, mean_f0, f90 = blend.f0_and_f90()
        if (highest - lowest).max() < 1e-6:
            return PbrSurface(factor, lowest, f90, roughness, specular_reflectance, textures)
        mean_f0 = np.maximum(mean_f0, 1e-4)
        textures["specular"] = self._count_texels(blend.normalized_f0(mean_f0, highest))
        return PbrSurface(factor, mean_f0, f90, roughness, specular_reflectance, textures)

    def _base_image(self, material: GltfMaterial, label: str) -> tuple[NDArray[np.uint8], tuple[str, str]] | None:
        """The base color texture times vertex colors, with its wrap modes; None if both are uniform."""
        info = material.pbrMetallicRoughness.baseColorTexture
        image = None if info is None else self._load_image(info, f"the base color texture of {label}")
        if self._colors is None:
            return image
        return self._colors.image if image is None else self._colors.multiply(image[0]), self._colors.wrap

    def _raster(self, material: GltfMaterial, extensions: MaterialExtensions, label: str) -> Raster:
        """The textures of the base layer, resampled to the size of the first."""
        pbr, base = material.pbrMetallicRoughness, self._base_image(material, label)
        infos = {
            "packed": (pbr.metallicRoughnessTexture, "metallic-roughness"),
            "specular": (extensions.specular.specularTexture, "specular"),
            "tint": (extensions.specular.specularColorTexture, "specular color"),
        }
        images = {} if base is None else {"base": base}
        images |= {
            key: self._load_image(info, f"the {texture_name} texture of {label}")
            for key, (info, texture_name) in infos.items()
            if info is not None
        }
        tiled = {key: info for key, (info, _) in infos.items()} | {"base": pbr.baseColorTexture}
        tiled_shapes = [
            images[key][0].shape for key, info in tiled.items() if info and self._uv_transforms.is_tiled(info)
        ]
        return Raster(
            images, (max((h for h, _, _ in tiled_shapes), default=0), max((w for _, w, _ in tiled_shapes), default=0))
        )

    def _coat_layer(self, extensions: MaterialExtensions, anisotropy: float, label: str) -> CoatLayer:
        coat, sheen = extensions.clearcoat, extensions.sheen
        weight = coat.clearcoatFactor * self._mean(coat.clearcoatTexture, 0, f"clearcoat texture of {label}")
        coat_roughness = coat.clearcoatRoughnessFactor
        if coat.clearcoatRoughnessTexture is not None:
            coat_roughness *= self._mean(coat.clearcoatRoughnessTexture, 1, f"clearcoat roughness texture of {label}")
        sheen_roughness = sheen.sheenRoughnessFactor
        if sheen.sheenRoughnessTexture is not None:
            sheen_roughness *= self._mean(sheen.sheenRoughnessTexture, 3, f"sheen roughness texture of {label}")
        tint = np.array(sheen.sheenColorFactor) * self._mean_color(sheen.sheenColorTexture, f"sheen texture of {label}")
        r, g, b = (round(float(value), 6) for value in tint)
        if r + g + b > 0:
            self._warnings.append(approximated(f"Energy loss under the sheen of {label} is approximated."))
        return CoatLayer(anisotropy, round(weight, 6), coat_roughness, (r, g, b), sheen_roughness)

    def _anisotropy(self, extensions: MaterialExtensions, label: str) -> tuple[float, float]:
        """Strength, and angle from the tangent to the anisotropy direction in radians; (0, 0) if isotropic."""
        anisotropy = extensions.anisotropy
        strength, rotation = anisotropy.anisotropyStrength, anisotropy.anisotropyRotation
        if anisotropy.anisotropyTexture is not None and strength > 0:
            pixels, _ = self._images.texture(anisotropy.anisotropyTexture.index, f"the anisotropy texture of {label}")
            x, y = (pixels[..., :2].mean((0, 1), dtype=np.float64) / 127.5 - 1).tolist()
            strength *= float(pixels[..., 2].mean()) / 255
            rotation += float(np.arctan2(y, x))
            if np.hypot(x, y) < 0.5:
                message = f"The anisotropy texture of {label} has no main direction; its highlight is round."
                self._warnings.append(approximated(message))
                return 0.0, 0.0
            if np.ptp(pixels[..., :3].reshape(-1, 3), axis=0).max() > 2:
                self._warnings.append(approximated(f"The anisotropy texture of {label} was replaced by its average."))
        if strength == 0:
            return 0.0, 0.0
        message = f"The anisotropic highlight of {label} is approximated (Ashikhmin-Shirley, similar width)."
        self._warnings.append(approximated(message))
        return strength, float(np.remainder(rotation, 2 * np.pi))

    def _normal_map(self, info: TextureInfo | None, tangent_rotation: float, label: str) -> Texture | None:
        """The normal map as a texture, in tangent frames that are rotated by `tangent_rotation`."""
        if info is None:
            return None
        pixels, wrap = self._load_image(info, f"the normal texture of {label}")
        scale = float(np.clip(info.scale, -100, 100))
        encoding = TextureEncoding("normal", (scale, scale, 1.0), tangent_rotation)
        return self._count_texels(Texture(np.ascontiguousarray(pixels[..., :3]), wrap, encoding))

    def _load_image(self, info: TextureInfo, label: str) -> tuple[NDArray[np.uint8], tuple[str, str]]:
        """Load a texture, tiled for the UV coordinates of the meshes, with its wrap modes."""
        pixels, wrap = self._images.texture(info.index, label)
        pixels = self._uv_transforms.tile_image(info, pixels, wrap)
        return (pixels, wrap) if self._colors is None else self._colors.place(pixels, wrap)

    def _mean(self, info: TextureInfo | None, channel: int, label: str) -> float:
        """Mean of one channel in [0, 1], with a warning if it varies; 1 without a texture."""
        if info is None:
            return 1.0
        pixels, _ = self._images.texture(info.index, f"the {label}")
        if np.ptp(pixels[..., channel]) > 2:
            self._warnings.append(approximated(f"The {label} was replaced by its average."))
        return float(pixels[..., channel].mean()) / 255

    def _mean_color(self, info: TextureInfo | None, label: str) -> Any:
        if info is None:
            return np.ones(3)
        pixels, _ = self._images.texture(info.index, f"the {label}")
        if np.ptp(pixels[..., :3].reshape(-1, 3), axis=0).max() > 2:
            self._warnings.append(approximated(f"The {label} was replaced by its average."))
        return mean_value(Texture(pixels[..., :3], encoding=TextureEncoding("srgb")))

    def _count_texels(self, texture: Texture) -> Texture:
        self._remaining_texels -= texture.pixels.size // 3
        if self._remaining_texels < 0:
            raise SceneError(f"the scene's textures have more than {MAX_TEXTURE_TEXELS:,} texels; scale them down")
        return texture

    def _warn_unsupported(self, material: GltfMaterial, label: str) -> None:
        if material.occlusionTexture is not None:
            self._occluded_materials.append(label)

    def warn_occlusion_maps(self) -> None:
        """Add one warning for the occlusion textures of all materials that were read."""
        num_materials = len(self._occluded_materials)
        if num_materials:
            materials = self._occluded_materials[0] if num_materials == 1 else f"{num_materials} materials"
            self._warnings.append(ignored(f"AO maps ignored on {materials}: occlusion is ray-traced."))


def _infos(material: GltfMaterial, extensions: MaterialExtensions) -> list[TextureInfo | None]:
    """Textures that are used as images, the most important first."""
    pbr, specular = material.pbrMetallicRoughness, extensions.specular
    images = [pbr.baseColorTexture, pbr.metallicRoughnessTexture, material.normalTexture]
    return [*images, specular.specularTexture, specular.specularColorTexture, material.emissiveTexture]


def _scale_base_color(material: GltfMaterial, factor: tuple[float, float, float, float]) -> GltfMaterial:
    """Multiply the base color of a material."""
    pbr = material.pbrMetallicRoughness
    scaled = [component * scale for component, scale in zip(pbr.baseColorFactor, factor, strict=True)]
    return material.model_copy(update={"pbrMetallicRoughness": pbr.model_copy(update={"baseColorFactor": scaled})})


def _normalize_roughness(raster: Raster) -> Texture:
    """Roughness texture over its mean."""
    scale = 1 / raster.mean("packed", 1)
    pixels = np.ascontiguousarray(raster.channel("packed", 1))
    return Texture(pixels, raster.wrap, TextureEncoding("share", (scale, scale, scale)))


def _f0(ior: float) -> float:
    """Reflectance of a dielectric at normal incidence; an index of 0 means a mirror, as in the extension."""
    return 1.0 if ior == 0 else ((ior - 1) / (ior + 1)) ** 2
