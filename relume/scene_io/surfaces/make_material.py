"""Materials of surface parameters: factors and textures of the base layer, which `to_terms` converts.

With base color b, metallic m and specular s with color c: lambert has b (1 - m), the highlight has
f0 = mix(s min(c f, 1), b, m) and f90 = mix(s, 1, m), with f from the index of refraction. glTF 2.0 specification,
appendix B, and the specifications of the extensions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.fresnel import normal_reflectance
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored, quote, unsupported
from relume.scene.model import Glass, Material, Opacity, Texture, TextureEncoding
from relume.scene.opacity import make_opacity
from relume.scene.texture_encoding import mean_value
from relume.scene.textured_vertex_colors import TexturedColors
from relume.scene.unique_names import unique_name
from relume.scene.validate import MAX_IOR
from relume.scene_io.surfaces.blend import MetallicBlend, lerp
from relume.scene_io.surfaces.material_textures import (
    MaterialTextures,
    TextureLayout,
    TextureSource,
    split_factor,
    split_strength,
)
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_parameters import WHITE, SurfaceParameters
from relume.scene_io.surfaces.texture_resampling import NOISE, Raster
from relume.scene_io.surfaces.to_terms import CoatLayer, PbrSurface, f82_coefficient, make_terms
from relume.scene_io.surfaces.uv_transforms import UvSlot

F64 = NDArray[np.float64]
MAX_TEXTURE_TEXELS = 700_000_000  # of all materials of a scene, 3 bytes each
_MAX_NORMAL_SCALE = 100.0


@dataclass(frozen=True)
class VertexColors:
    """Vertex colors of a material.

    Attributes:
        factor: RGB and alpha that multiply the base color.
        textured: multiplies the base color texture, if there is one; None if the colors are uniform.
    """

    factor: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    textured: TexturedColors | None = None


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


NO_COLORS = VertexColors()


class SurfaceMaterials:
    """Makes the materials of one document, with unique names and a limit on their texels.

    Args:
        images: of the document. warnings: gets a sentence for each approximation.
    """

    def __init__(self, images: TextureSource, warnings: list[ImporterWarning]) -> None:
        self._images, self._warnings = images, warnings
        self._names: dict[str, int] = {}
        self._remaining_texels = MAX_TEXTURE_TEXELS
        self._occluded_materials: list[str] = []

    def make(
        self, name: str, surface: SurfaceParameters, colors: VertexColors = NO_COLORS, *, double_sided: bool = True
    ) -> ReadMaterial:
        """Make a material.

        Args:
            name: shown to users. surface: its parameters, whose images can be used. colors: vertex colors of its
                meshes. double_sided: whether both sides are shown.
        Raises:
            SceneError: a texture is unusable or there are too many texels.
        """
        name = unique_name(name or "material", self._names)
        label = f"material {quote(name)}"
        self._occluded_materials += [label] * surface.has_occlusion
        textures = MaterialTextures(self._images, surface, colors.textured, label, self._warnings)
        base = self._base_layer(surface, colors, textures)
        strength, tangent_rotation = self._anisotropy(surface, textures, label)
        transmission = float(textures.mean(surface.transmission, "transmission")[0])
        glass = self._glass(surface, base, transmission, textures, label) if transmission > 0 else None
        if glass is None:
            self._warn_unphysical_ior(surface, label)
        if strength > 0 and "roughness" in base.textures:
            message = f"The roughness texture of {label} was replaced by its average because it is anisotropic."
            self._warnings.append(approximated(message))
        coat_layer = self._coat_layer(surface, strength, textures, label)
        normal_map = self._normal_map(surface.normal, tangent_rotation, textures)
        emission_textures = self._emission_textures(surface, textures)
        if coat_layer.coat > 0:
            self._warn_coat_normals(surface, label, has_normal_map=normal_map is not None)
        base = replace(
            base,
            diffuse=base.diffuse * (1 - transmission),
            edge_loss=self._edge_loss(surface, textures),
            has_normal_map=normal_map is not None,
        )
        material = Material(
            name,
            make_terms(base, coat_layer),
            base.textures | emission_textures,
            normal_map,
            double_sided,
            opacity=self._opacity(surface, colors, textures, label),
            glass=glass,
        )
        has_own_uvs = colors.textured is not None and colors.textured.corner_uvs is not None
        red, green, blue = (split_factor(surface.emission, np.inf) * surface.emission_strength).tolist()
        return ReadMaterial(
            material,
            UvSlot() if has_own_uvs else textures.transforms.slot,
            tangent_rotation if strength > 0 else None,
            (red, green, blue),
        )

    def texture_layout(self, name: str, surface: SurfaceParameters) -> TextureLayout | None:
        """Find where the textures of a material are; None if it has none that are used as images.

        Args:
            name, surface: as in `make`.
        """
        return MaterialTextures(self._images, surface, None, f"material {quote(name or 'material')}", []).layout()

    def warn_occlusion_maps(self) -> None:
        """Add one warning for the occlusion maps of all materials."""
        num_materials = len(self._occluded_materials)
        if num_materials:
            materials = self._occluded_materials[0] if num_materials == 1 else f"{num_materials} materials"
            self._warnings.append(ignored(f"AO maps ignored on {materials}: occlusion is ray-traced."))

    def _base_layer(self, surface: SurfaceParameters, colors: VertexColors, textures: MaterialTextures) -> PbrSurface:
        """The base layer, with textures only if their values vary."""
        raster = textures.raster()
        factor = split_factor(surface.base_color) * colors.factor[:3]
        dielectric = f0_of(surface) * split_factor(surface.specular_color, np.inf)
        metallic, weight = (float(split_factor(value)[0]) for value in (surface.metallic, surface.specular))
        roughness = raster.mean("packed", 1) * float(split_factor(surface.roughness)[0])
        blend = MetallicBlend(raster, factor, dielectric, metallic, weight)
        specular_reflectance = 0.0 if blend.reflectance_varies else blend.mean_reflectance()
        if raster.empty:
            f0 = lerp(weight * np.minimum(dielectric, 1), factor, metallic)
            f90 = lerp(weight, 1, metallic)
            return PbrSurface(factor * (1 - metallic), f0, f90, roughness, specular_reflectance)
        layers = {"diffuse": self._count_texels(blend.diffuse())}
        if roughness > 0 and raster.varies("packed", 1):
            layers["roughness"] = self._count_texels(_normalize_roughness(raster))
        lowest, highest, mean_f0, f90 = blend.f0_and_f90()
        if (highest - lowest).max() < 1e-6:
            return PbrSurface(factor, lowest, f90, roughness, specular_reflectance, layers)
        mean_f0 = np.maximum(mean_f0, 1e-4)
        layers["specular"] = self._count_texels(blend.normalized_f0(mean_f0, highest))
        return PbrSurface(factor, mean_f0, f90, roughness, specular_reflectance, layers)

    def _edge_loss(self, surface: SurfaceParameters, textures: MaterialTextures) -> Shaped[F64, " 3"]:
        """Coefficient of the metal's F82-tint; zeros without an edge tint."""
        if surface.edge_tint == WHITE:
            return np.zeros(3)
        metallic = textures.mean(surface.metallic, "metallic")
        return metallic * f82_coefficient(textures.mean(surface.base_color, "base color"), np.array(surface.edge_tint))

    def _glass(
        self, surface: SurfaceParameters, base: PbrSurface, transmission: float, textures: MaterialTextures, label: str
    ) -> Glass:
        """Thin or solid glass: tinted, and absorbing inside a solid."""
        ior = surface.ior
        if not 1 <= ior <= MAX_IOR:
            message = f"The index of refraction {ior:g} of {label} is out of range; 1.5 is used."
            self._warnings.append(unsupported(message))
            ior = 1.5
        if surface.transmission_color is None:
            tint = base.diffuse * (mean_value(base.textures["diffuse"]) if "diffuse" in base.textures else 1.0)
        else:
            metallic = float(textures.mean(surface.metallic, "metallic")[0])
            tint = (1 - metallic) * textures.mean(surface.transmission_color, "transmission color")
        absorbed = np.log(1 / np.maximum(surface.attenuation_color, 1e-6)) / surface.attenuation_distance
        red, green, blue = np.clip(tint * transmission, 0, 1).tolist()
        r, g, b = absorbed.tolist() if surface.thickness > 0 else (0.0, 0.0, 0.0)
        roughness = base.roughness if surface.transmission_roughness is None else surface.transmission_roughness
        return Glass((red, green, blue), ior, surface.thickness, (r, g, b), roughness)

    def _warn_coat_normals(self, surface: SurfaceParameters, label: str, *, has_normal_map: bool) -> None:
        """Warn if the coat has other normals than the base layer; a view sample has one normal for both."""
        if has_normal_map or surface.has_clearcoat_normal:
            appearance = "follows the base normal map" if has_normal_map else "is smooth"
            original = "it has its own normal map" if surface.has_clearcoat_normal else "it is smooth"
            self._warnings.append(approximated(f"Clearcoat on {label} {appearance}; in the file {original}."))

    def _warn_unphysical_ior(self, surface: SurfaceParameters, label: str) -> None:
        """Warn about an index of refraction that no opaque material has, unless the file gives f0 itself."""
        if surface.has_f0:
            return
        ior, color = surface.ior, split_factor(surface.specular_color, np.inf)
        reflectance = min(1.0, f0_of(surface) * float(color.max())) * float(split_factor(surface.specular)[0])
        if 0 < ior < 1 or reflectance > _f0(MAX_IOR):
            message = f"Unusual index of refraction {ior:g} on {label} (default 1.5): non-metallic parts reflect"
            self._warnings.append(unsupported(f"{message} {reflectance:.0%} of the light at normal incidence."))

    def _opacity(
        self, surface: SurfaceParameters, colors: VertexColors, textures: MaterialTextures, label: str
    ) -> Opacity | None:
        """Opacity of a material; alpha is ignored in other alpha modes."""
        if surface.alpha_mode not in ("MASK", "BLEND"):
            if surface.alpha_mode != "OPAQUE":
                message = f"The alpha mode {quote(surface.alpha_mode)} of {label} isn't supported; it is shown opaque."
                self._warnings.append(unsupported(message))
            return None
        alpha, wrap = None, ("repeat", "repeat")
        if (base := textures.load("base")) is not None:
            alpha, wrap = base[0][..., 3], base[1]
        factor = float(split_factor(surface.alpha)[0]) * colors.factor[3]
        cutoff = surface.alpha_cutoff if surface.alpha_mode == "MASK" else None
        return make_opacity(alpha, wrap, factor, cutoff, label, self._warnings)

    def _emission_textures(self, surface: SurfaceParameters, textures: MaterialTextures) -> dict[str, Texture]:
        """The emission texture."""
        image = textures.load("emission") if isinstance(surface.emission, ImageInput) else None
        if image is None or split_factor(surface.emission, np.inf).max() <= 0:
            return {}
        pixels, wrap = image
        texture = Texture(np.ascontiguousarray(pixels[..., :3]), wrap, TextureEncoding("srgb"))
        return {"emission": self._count_texels(texture)}

    def _coat_layer(
        self, surface: SurfaceParameters, anisotropy: float, textures: MaterialTextures, label: str
    ) -> CoatLayer:
        weight = float(textures.mean(surface.clearcoat, "clearcoat")[0])
        coat_roughness = float(textures.mean(surface.clearcoat_roughness, "clearcoat roughness")[0])
        sheen_roughness = float(textures.mean(surface.sheen_roughness, "sheen roughness")[0])
        tint = textures.mean(surface.sheen_weight, "fuzz")
        tint = tint * textures.mean(surface.sheen_color, "sheen") if tint.any() else tint
        r, g, b = (round(float(value), 6) for value in tint)
        if r + g + b > 0:
            self._warnings.append(approximated(f"Energy loss under the sheen of {label} is approximated."))
        red, green, blue = lerp(1.0, textures.mean(surface.clearcoat_color, "coat color"), weight).tolist()
        return CoatLayer(
            anisotropy,
            round(weight, 6),
            coat_roughness,
            (r, g, b),
            sheen_roughness,
            _f0(surface.clearcoat_ior),
            (red, green, blue),
        )

    def _anisotropy(self, surface: SurfaceParameters, textures: MaterialTextures, label: str) -> tuple[float, float]:
        """Strength, and angle from the tangent to the anisotropy direction in radians; (0, 0) if isotropic."""
        strength, rotation = surface.anisotropy, surface.anisotropy_rotation
        if surface.anisotropy_map is not None and strength > 0:
            pixels = textures.pixels(surface.anisotropy_map, "anisotropy")
            x, y = (pixels[..., :2].mean((0, 1), dtype=np.float64) / 127.5 - 1).tolist()
            strength *= float(pixels[..., 2].mean()) / 255
            rotation += float(np.arctan2(y, x))
            if np.hypot(x, y) < 0.5:
                message = f"The anisotropy texture of {label} has no main direction; its highlight is round."
                self._warnings.append(approximated(message))
                return 0.0, 0.0
            if np.ptp(pixels[..., :3].reshape(-1, 3), axis=0).max() > NOISE:
                self._warnings.append(approximated(f"The anisotropy texture of {label} was replaced by its average."))
        if strength == 0:
            return 0.0, 0.0
        message = f"The anisotropic highlight of {label} is approximated (Ashikhmin-Shirley, similar width)."
        self._warnings.append(approximated(message))
        return strength, float(np.remainder(rotation, 2 * np.pi))

    def _normal_map(
        self, normal: ImageInput | None, tangent_rotation: float, textures: MaterialTextures
    ) -> Texture | None:
        """The normal map as a texture, in tangent frames that are rotated by `tangent_rotation`."""
        image = textures.load("normal")
        if normal is None or image is None:
            return None
        scale = float(np.clip(split_strength(normal)[0], -_MAX_NORMAL_SCALE, _MAX_NORMAL_SCALE))
        encoding = TextureEncoding("normal", (scale, scale, 1.0), tangent_rotation)
        return self._count_texels(Texture(np.ascontiguousarray(image[0][..., :3]), image[1], encoding))

    def _count_texels(self, texture: Texture) -> Texture:
        self._remaining_texels -= texture.pixels.size // 3
        if self._remaining_texels < 0:
            raise SceneError(f"the scene's textures have more than {MAX_TEXTURE_TEXELS:,} texels; scale them down")
        return texture


def f0_of(surface: SurfaceParameters) -> float:
    """Reflectance of the dielectric at normal incidence, without its color."""
    return 1.0 if surface.has_f0 else _f0(surface.ior)


def _f0(ior: float) -> float:
    """Reflectance of a dielectric at normal incidence; an index of 0 means a mirror, as in the extension."""
    return 1.0 if ior == 0 else normal_reflectance(ior)


def _normalize_roughness(raster: Raster) -> Texture:
    """Roughness texture over its mean."""
    scale = 1 / raster.mean("packed", 1)
    pixels = np.ascontiguousarray(raster.channel("packed", 1))
    return Texture(pixels, raster.wrap, TextureEncoding("share", (scale, scale, scale)))
