"""Materials of a glTF file: numbers and textures brought to the base layer that `terms` describes.

Base colour b, metallic m, specular s with colour c: lambert takes b (1 - m), the highlight has
f0 = mix(s min(c f, 1), b, m) and f90 = mix(s, 1, m), with f from the index of refraction. glTF 2.0 specification,
appendix B, and the extensions' own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.errors import SceneError
from relume.remarks import Remark, simplified, unused, wrong
from relume.scene.checks import MAX_IOR
from relume.scene.coding import mean_of
from relume.scene.gltf.blend import Blend, mix
from relume.scene.gltf.document import Material as GltfMaterial
from relume.scene.gltf.document import TextureInfo
from relume.scene.gltf.images import ImageReader
from relume.scene.gltf.layers import Clearcoat, Layers, read_layers
from relume.scene.gltf.names import unique_name
from relume.scene.gltf.raster import Raster
from relume.scene.gltf.terms import Over, Surface, dielectric_share, make_terms
from relume.scene.gltf.uvs import Placements, UvUse
from relume.scene.model import Coding, Glass, Material, Opacity, Texture
from relume.scene.opacity import make_opacity
from relume.scene.vertex_colors import WRAP

_CLEAR = 0.1  # roughness of glass that blurs nothing to speak of
MAX_TEXTURE_TEXELS = 700_000_000  # kept for the materials of one scene, 3 bytes each


@dataclass(frozen=True)
class VertexColors:
    """What colours of vertices are to a material.

    Attributes:
        factor: RGB and alpha that multiply the base colour.
        image: that stands for its texture; None where it has none, or the colours are all alike. (height, width, 4)
    """

    factor: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    image: NDArray[np.uint8] | None = None


@dataclass(frozen=True)
class Understood:
    """A material, which texture coordinates its meshes must carry, and how far their tangents are turned, or None.

    Attributes:
        turn: radians, from the tangent towards the bitangent; None where the material is isotropic.
        emission: radiance, which the image of that name multiplies.
    """

    material: Material
    uv_use: UvUse
    turn: float | None = None
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)


WHITE = VertexColors()


class MaterialReader:
    """Turns the materials of one file into relume's, counting the texels it makes."""

    def __init__(self, images: ImageReader, warnings: list[Remark]) -> None:
        self._images = images
        self._warnings = warnings
        self._names: dict[str, int] = {}
        self._texels_left = MAX_TEXTURE_TEXELS

    def read(self, material: GltfMaterial, colors: VertexColors = WHITE) -> Understood:
        """One material under a name of its own.

        Args:
            material: as the file has it. colors: of the vertices that wear it.
        Raises:
            SceneError: a texture cannot be used or there are too many texels.
        """
        name = unique_name(material.name or "material", self._names)
        what = f"material {name!r}"
        layers = read_layers(material.extensions, what, self._warnings)
        self._warn_of_the_rest(material, what)
        infos = [info for info in _infos(material, layers) if info is not None]
        self._placements = Placements(infos, what, self._warnings)
        material = _times(material, colors.factor)
        surface = self._surface(material, layers, self._raster(material, layers, colors.image, what))
        strength, turn = self._anisotropy(layers, what)
        transmission = self._transmission(layers, what)
        glass = self._glass(surface, layers, transmission, what) if transmission > 0 else None
        if glass is None:
            self._doubt(layers, what)
        surface = replace(surface, diffuse=surface.diffuse * (1 - transmission))
        if strength > 0 and "roughness" in surface.textures:
            self._warnings.append(simplified(f"the roughness texture of {what}, which is anisotropic, is its mean"))
        over = self._over(layers, strength, what)
        normal_map = self._normal_map(material.normalTexture, turn, what)
        shining = self._shining(material, what)
        if over.coat > 0:
            self._doubt_coat(layers.clearcoat, what, is_bumpy=normal_map is not None)
        made = Material(
            name,
            make_terms(replace(surface, has_normal_map=normal_map is not None), over),
            surface.textures | shining,
            normal_map,
            material.doubleSided,
            opacity=self._opacity(material, colors.image, what),
            glass=glass,
        )
        turned = turn if strength > 0 else None
        return Understood(made, self._placements.use, turned, self._emission(material, layers, what))

    def _transmission(self, layers: Layers, what: str) -> float:
        passing = layers.transmission
        return passing.transmissionFactor * self._mean(
            passing.transmissionTexture, 0, f"transmission texture of {what}"
        )

    def _glass(self, surface: Surface, layers: Layers, share: float, what: str) -> Glass:
        """How light passes: tinted by the base colour, and inside of a solid by what it absorbs."""
        volume, ior = layers.volume, layers.ior.ior
        if surface.roughness > _CLEAR:
            self._warnings.append(simplified(f"{what} is frosted; what is behind it is seen sharply"))
        if not 1 <= ior <= MAX_IOR:
            self._warnings.append(wrong(f"{what} has an index of refraction of {ior:g}; it bends as if it had 1.5"))
            ior = 1.5
        tint = surface.diffuse * share
        if "diffuse" in surface.textures:
            tint = tint * mean_of(surface.textures["diffuse"])
        absorbed = -np.log(np.maximum(volume.attenuationColor, 1e-6)) / volume.attenuationDistance
        red, green, blue = np.clip(tint, 0, 1).tolist()
        r, g, b = absorbed.tolist() if volume.thicknessFactor > 0 else (0.0, 0.0, 0.0)
        return Glass((red, green, blue), ior, volume.thicknessFactor, (r, g, b))

    def _doubt_coat(self, coat: Clearcoat, what: str, *, is_bumpy: bool) -> None:
        """Tell of bumps that a coat has not in common with what it covers; a sample has one normal for both."""
        has_own = coat.clearcoatNormalTexture is not None
        if is_bumpy or has_own:
            shown = "as bumpy as what it covers" if is_bumpy else "smooth, as what it covers"
            said = "its own normal texture is not used" if has_own else "in the file it is smooth"
            self._warnings.append(simplified(f"the coat of {what} is shown {shown}; {said}"))

    def _doubt(self, layers: Layers, what: str) -> None:
        """Tell of an index of refraction that no opaque matter has; what stands for a mirror is tinted or weak."""
        ior, specular = layers.ior.ior, layers.specular
        share = min(1.0, _f0(ior) * max(specular.specularColorFactor)) * specular.specularFactor
        if 0 < ior < 1 or share > _f0(MAX_IOR):
            told = f"{what} has an index of refraction of {ior:g}; where it is no metal, {share:.0%} of the light that"
            self._warnings.append(wrong(f"{told} falls straight on it is reflected (1.5 is usual)"))

    def _opacity(self, material: GltfMaterial, colors: NDArray[np.uint8] | None, what: str) -> Opacity | None:
        """Where the material has holes; alpha that is not asked for is not looked at."""
        if material.alphaMode not in ("MASK", "BLEND"):
            if material.alphaMode != "OPAQUE":
                self._warnings.append(
                    wrong(f"{what} has the alpha mode {material.alphaMode[:20]!r}; it is opaque here")
                )
            return None
        pbr, alpha, wrap = material.pbrMetallicRoughness, None, ("repeat", "repeat")
        if pbr.baseColorTexture is not None:
            pixels, wrap = self._placed(pbr.baseColorTexture, f"the base colour texture of {what}")
            alpha = pixels[..., 3]
        elif colors is not None:
            alpha, wrap = colors[..., 3], WRAP
        cutoff = material.alphaCutoff if material.alphaMode == "MASK" else None
        return make_opacity(alpha, wrap, pbr.baseColorFactor[3], cutoff, what, self._warnings)

    def _emission(self, material: GltfMaterial, layers: Layers, what: str) -> tuple[float, float, float]:
        factor = np.maximum(material.emissiveFactor, 0) * layers.emissive_strength.emissiveStrength
        red, green, blue = factor.tolist()
        return red, green, blue

    def _shining(self, material: GltfMaterial, what: str) -> dict[str, Texture]:
        """The image of what surfaces shine, as it is in the file."""
        if material.emissiveTexture is None or max(material.emissiveFactor) <= 0:
            return {}
        pixels, wrap = self._placed(material.emissiveTexture, f"the emission texture of {what}")
        return {"emission": self._kept(Texture(np.ascontiguousarray(pixels[..., :3]), wrap, Coding("srgb")))}

    def _surface(self, material: GltfMaterial, layers: Layers, raster: Raster) -> Surface:
        """The base layer; images only where a texture says more than one value."""
        pbr, specular = material.pbrMetallicRoughness, layers.specular
        factor = np.array(pbr.baseColorFactor[:3])
        dielectric = _f0(layers.ior.ior) * np.array(specular.specularColorFactor)
        roughness = raster.mean("packed", 1) * pbr.roughnessFactor
        reflected = dielectric_share(
            float(np.minimum(dielectric, 1).max()) * specular.specularFactor, specular.specularFactor
        )
        if raster.empty:
            metallic, weight = pbr.metallicFactor, specular.specularFactor
            f0 = mix(weight * np.minimum(dielectric, 1), factor, metallic)
            return Surface(factor * (1 - metallic), f0, mix(weight, 1, metallic), roughness, reflected)
        blend = Blend(raster, factor, dielectric, pbr.metallicFactor, specular.specularFactor)
        textures = {"diffuse": self._kept(blend.diffuse())}
        if roughness > 0 and raster.varies("packed", 1):
            textures["roughness"] = self._kept(_over_mean(raster))
        lowest, highest, mean_f0, f90 = blend.f0_and_f90()
        if (highest - lowest).max() < 1e-6:
            return Surface(factor, lowest, f90, roughness, reflected, textures)
        mean_f0 = np.maximum(mean_f0, 1e-4)
        textures["specular"] = self._kept(blend.f0_over(mean_f0, highest))
        return Surface(factor, mean_f0, f90, roughness, reflected, textures)

    def _raster(self, material: GltfMaterial, layers: Layers, colors: NDArray[np.uint8] | None, what: str) -> Raster:
        """The images that the base layer is made of, all in the size of the first."""
        if colors is not None:
            return Raster({"base": (colors, WRAP)})
        pbr = material.pbrMetallicRoughness
        infos = {
            "base": (pbr.baseColorTexture, "base colour"),
            "packed": (pbr.metallicRoughnessTexture, "metallic-roughness"),
            "specular": (layers.specular.specularTexture, "specular"),
            "tint": (layers.specular.specularColorTexture, "specular colour"),
        }
        images = {
            key: self._placed(info, f"the {words} texture of {what}")
            for key, (info, words) in infos.items()
            if info is not None
        }
        tiled = [images[key][0].shape for key, (info, _) in infos.items() if info and self._placements.repeats(info)]
        return Raster(images, (max((h for h, _, _ in tiled), default=0), max((w for _, w, _ in tiled), default=0)))

    def _over(self, layers: Layers, anisotropy: float, what: str) -> Over:
        coat, sheen = layers.clearcoat, layers.sheen
        weight = coat.clearcoatFactor * self._mean(coat.clearcoatTexture, 0, f"coat texture of {what}")
        coat_roughness = coat.clearcoatRoughnessFactor
        if coat.clearcoatRoughnessTexture is not None:
            coat_roughness *= self._mean(coat.clearcoatRoughnessTexture, 1, f"coat roughness texture of {what}")
        sheen_roughness = sheen.sheenRoughnessFactor
        if sheen.sheenRoughnessTexture is not None:
            sheen_roughness *= self._mean(sheen.sheenRoughnessTexture, 3, f"sheen roughness texture of {what}")
        tint = np.array(sheen.sheenColorFactor) * self._mean_color(sheen.sheenColorTexture, f"sheen texture of {what}")
        r, g, b = (round(float(value), 6) for value in tint)
        if r + g + b > 0:
            self._warnings.append(simplified(f"what lies under the sheen of {what} is dimmed by two curves' product"))
        return Over(anisotropy, round(weight, 6), coat_roughness, (r, g, b), sheen_roughness)

    def _anisotropy(self, layers: Layers, what: str) -> tuple[float, float]:
        """Strength, and radians from the tangent to the direction of it; (0, 0) where the material is isotropic."""
        stretched = layers.anisotropy
        strength, turn = stretched.anisotropyStrength, stretched.anisotropyRotation
        if stretched.anisotropyTexture is not None and strength > 0:
            pixels, _ = self._images.texture(stretched.anisotropyTexture.index, f"the anisotropy texture of {what}")
            x, y = (pixels[..., :2].mean((0, 1), dtype=np.float64) / 127.5 - 1).tolist()
            strength *= float(pixels[..., 2].mean()) / 255
            turn += float(np.arctan2(y, x))
            if np.hypot(x, y) < 0.5:
                self._warnings.append(
                    simplified(f"the anisotropy of {what} runs in all directions; its highlight is round")
                )
                return 0.0, 0.0
            if np.ptp(pixels[..., :3].reshape(-1, 3), axis=0).max() > 2:
                self._warnings.append(simplified(f"the anisotropy texture of {what} is replaced by its mean"))
        if strength == 0:
            return 0.0, 0.0
        self._warnings.append(
            simplified(f"{what} is anisotropic; its highlight is Ashikhmin-Shirley's, of about the same width")
        )
        return strength, float(np.remainder(turn, 2 * np.pi))

    def _normal_map(self, info: TextureInfo | None, turn: float, what: str) -> Texture | None:
        """Unit normals, in the frame of tangents turned by `turn`."""
        if info is None:
            return None
        pixels, wrap = self._placed(info, f"the normal texture of {what}")
        scale = float(np.clip(info.scale, -100, 100))
        coding = Coding("normal", (scale, scale, 1.0), turn)
        return self._kept(Texture(np.ascontiguousarray(pixels[..., :3]), wrap, coding))

    def _placed(self, info: TextureInfo, words: str) -> tuple[NDArray[np.uint8], tuple[str, str]]:
        """An image, placed as the meshes' coordinates want it, and how it wraps."""
        pixels, wrap = self._images.texture(info.index, words)
        return self._placements.placed(info, pixels, wrap), wrap

    def _mean(self, info: TextureInfo | None, channel: int, words: str) -> float:
        """Mean of one channel, in [0, 1]; 1 without a texture, and a warning where it varies."""
        if info is None:
            return 1.0
        pixels, _ = self._images.texture(info.index, f"the {words}")
        if np.ptp(pixels[..., channel]) > 2:
            self._warnings.append(simplified(f"the {words} is replaced by its mean"))
        return float(pixels[..., channel].mean()) / 255

    def _mean_color(self, info: TextureInfo | None, words: str) -> Any:
        if info is None:
            return np.ones(3)
        pixels, _ = self._images.texture(info.index, f"the {words}")
        if np.ptp(pixels[..., :3].reshape(-1, 3), axis=0).max() > 2:
            self._warnings.append(simplified(f"the {words} is replaced by its mean"))
        return mean_of(Texture(pixels[..., :3], coding=Coding("srgb")))

    def _kept(self, texture: Texture) -> Texture:
        self._texels_left -= texture.pixels.size // 3
        if self._texels_left < 0:
            raise SceneError(f"the scene needs more than {MAX_TEXTURE_TEXELS:,} texels; scale its textures down")
        return texture

    def _warn_of_the_rest(self, material: GltfMaterial, what: str) -> None:
        if material.occlusionTexture is not None:
            self._warnings.append(unused(f"the occlusion texture of {what} is not used; relume traces occlusion"))


def _infos(material: GltfMaterial, layers: Layers) -> list[TextureInfo | None]:
    """The textures that are kept as images, first those that the others should follow."""
    pbr, specular = material.pbrMetallicRoughness, layers.specular
    images = [pbr.baseColorTexture, pbr.metallicRoughnessTexture, material.normalTexture]
    return [*images, specular.specularTexture, specular.specularColorTexture, material.emissiveTexture]


def has_textures(material: GltfMaterial) -> bool:
    """Whether a material names any image."""
    pbr = material.pbrMetallicRoughness
    named = [pbr.baseColorTexture, pbr.metallicRoughnessTexture, material.normalTexture, material.emissiveTexture]
    of_extensions = (of for of in material.extensions.values() if isinstance(of, dict))
    return any(info is not None for info in named) or any(
        key.endswith("Texture") for extension in of_extensions for key in extension
    )


def _times(material: GltfMaterial, factor: tuple[float, float, float, float]) -> GltfMaterial:
    """A material whose base colour is multiplied."""
    pbr = material.pbrMetallicRoughness
    times = [one * other for one, other in zip(pbr.baseColorFactor, factor, strict=True)]
    return material.model_copy(update={"pbrMetallicRoughness": pbr.model_copy(update={"baseColorFactor": times})})


def _over_mean(raster: Raster) -> Texture:
    """Roughness over its mean, texel by texel."""
    most = 1 / raster.mean("packed", 1)
    pixels = np.ascontiguousarray(raster.channel("packed", 1))
    return Texture(pixels, raster.wrap, Coding("share", (most, most, most)))


def _f0(ior: float) -> float:
    """Reflectance of a dielectric head-on; the extension's 0 stands for a mirror."""
    return 1.0 if ior == 0 else ((ior - 1) / (ior + 1)) ** 2
