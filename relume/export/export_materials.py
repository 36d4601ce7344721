"""Materials as a look shows them, as principled surfaces with images."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.roughness_levels import uses_roughness_map
from relume.brdf.texture_slots import is_user_image, roughness_image, texture_channel, user_images
from relume.core.import_warnings import quote
from relume.export.base_layer import Maps, base_layer, pbr_surface
from relume.export.export_images import ExportImages, color_image, rgb
from relume.export.principled_fit import EXACT, PrincipledFit, fit_principled, surface_error
from relume.images.image_store import load_normal_map, load_roughness_map, load_texture
from relume.look import Look, MaterialLook
from relume.look.glass import with_glass_look
from relume.look.model import MeshLook
from relume.look.single_lights import single_lights
from relume.look.uv_transforms import check_uv_transforms, fixed_images
from relume.math.uv_transform import UvTransform
from relume.scene.model import Glass, Material, Scene, Texture
from relume.scene.texture_encoding import decode
from relume.scene.triplanar import find_triplanar
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class ExportMaterial:
    """A material of an export.

    Attributes:
        name: as in the scene.
        surface: its parameters; files of images are names in `ExportImages`.
        is_double_sided: both sides are visible.
        error: relative RMS error of cosine-weighted BRDF values, at the mean of the textures.
        omitted: a sentence for each feature that the surface does not have.
    """

    name: str
    surface: SurfaceParameters
    is_double_sided: bool
    error: float
    omitted: tuple[str, ...] = ()

    @property
    def is_exact(self) -> bool:
        """True if the surface has the values of the material's terms."""
        return self.error <= EXACT

    @property
    def uses_tangents(self) -> bool:
        """True if the tangents of the meshes matter."""
        return self.surface.normal is not None or self.surface.anisotropy > 0


@lru_cache(maxsize=1024)  # a report is followed by its file, and looks share most materials
def _fit(terms: str) -> PrincipledFit:
    """The surface of terms as JSON."""
    return fit_principled(json.loads(terms))


class MaterialExporter:
    """Converts the materials of one scene; equal materials of several looks are converted once.

    Args:
        scene: with all its arrays. images: gets the images of the materials.
    """

    def __init__(self, scene: Scene, images: ExportImages) -> None:
        self._scene, self._images = scene, images
        self._is_projected = find_triplanar(scene)
        self._materials: dict[tuple[Any, ...], ExportMaterial] = {}

    def materials(self, look: Look) -> list[ExportMaterial]:
        """Return all materials of the scene as a look shows them, in the scene's order.

        Raises:
            ParameterError: the look transforms images that cannot be transformed. NotFoundError: an image or measured
                data of the look do not exist. SceneError: they are damaged.
        """
        check_uv_transforms(look, fixed_images(self._scene))
        lights = {
            light.material: light for light in single_lights(self._scene, look).values() if isinstance(light, MeshLook)
        }
        return [self._material(k, look, lights.get(material.name)) for k, material in enumerate(self._scene.materials)]

    def _material(self, index: int, look: Look, light: MeshLook | None) -> ExportMaterial:
        name = self._scene.materials[index].name
        emission = (0.0, 0.0, 0.0) if light is None else light.gain
        image = None if light is None else light.image
        key = index, look.materials[name].model_dump_json(), emission, image
        if key not in self._materials:
            self._materials[key] = self._convert(index, look.materials[name], emission, image)
        return self._materials[key]

    def _convert(
        self, index: int, look: MaterialLook, emission: tuple[float, float, float], image: str | None
    ) -> ExportMaterial:
        material = with_glass_look(self._scene.materials[index], look.glass)
        terms = [dict(term) for term in look.terms]
        maps, roughness_map = term_maps(material, terms), _roughness_map(material, terms)
        mean_terms = at_mean(terms, maps.means())
        fit = _fit(json.dumps(mean_terms))
        layer = base_layer(fit.surface, maps, material.glass, self._images, material.name)
        uniform = base_layer(fit.surface, Maps(), material.glass, self._images, material.name)
        error = surface_error(mean_terms, fit._replace(surface=pbr_surface(_parameters(uniform, fit))))
        surface = replace(
            _parameters(layer, fit),
            roughness=self._roughness(fit, roughness_map, material),
            normal=self._normals(material, look),
            **_volume(material.glass),
            **self._emission(material, emission, image),
            **self._alpha(material),
        )
        omitted = _omitted(material, look, is_projected=self._is_projected[index] and bool(user_maps(terms)))
        placed = _with_transform(surface, look.uv_transform)
        return ExportMaterial(material.name, placed, material.double_sided, error, omitted)

    def _roughness(self, fit: PrincipledFit, texture: Texture | None, material: Material) -> float | ImageInput:
        """Roughness times its map; roughness above 1 is clamped."""
        if texture is None or texture.encoding is None or fit.coat.anisotropy > 0:
            return fit.surface.roughness
        factor = fit.surface.roughness * texture.encoding.scale[0]
        stretch = max(factor, 1.0)

        def make_pixels() -> NDArray[np.uint8]:
            return np.minimum(np.rint(texture.pixels * stretch), 255).astype(np.uint8)

        key = "roughness", id(texture), stretch
        file = self._images.add(
            f"{material.name} roughness", key, make_pixels if stretch > 1 else lambda: texture.pixels
        )
        return ImageInput(file, channel="r", factor=(min(factor, 1.0),) * 3, wrap=texture.wrap)

    def _normals(self, material: Material, look: MaterialLook) -> ImageInput | None:
        """Normals in the frame of the meshes' tangents."""
        texture = material.normal_map if look.normals is None else load_normal_map(look.normals)
        if texture is None:
            return None
        encoding, uv = texture.encoding, look.uv_transform or UvTransform()
        if encoding is not None and encoding.turn == 0 and uv.tangent_angle == 0 and not uv.is_mirrored:
            file = self._images.add(f"{material.name} normals", ("bytes", id(texture)), lambda: texture.pixels)
            return ImageInput(file, factor=(encoding.scale[0],) * 3, wrap=texture.wrap)

        def make_pixels() -> NDArray[np.uint8]:
            normals = uv.normals(decode(texture.pixels, encoding))
            return np.asarray(np.rint(127.5 * (normals + 1)), np.uint8)

        key = "normals", id(texture), uv.tangent_angle, uv.is_mirrored
        file = self._images.add(f"{material.name} normals", key, make_pixels)
        return ImageInput(file, wrap=texture.wrap)

    def _emission(self, material: Material, emission: tuple[float, float, float], image: str | None) -> dict[str, Any]:
        """Color of at most 1, and strength, of the light that the surfaces emit."""
        texture = material.textures.get("emission") if image is None else load_texture(image)
        radiance: F64 = np.array(emission)
        if radiance.max() <= 0:
            return {}
        scale = np.ones(3) if texture is None or texture.encoding is None else np.array(texture.encoding.scale)
        strength = max(float((radiance * scale).max()), 1.0)
        if texture is None:
            return {"emission": rgb(radiance / strength), "emission_strength": strength}
        name = f"{material.name} emission"
        return {
            "emission": color_image(self._images, name, texture, radiance / strength),
            "emission_strength": strength,
        }

    def _alpha(self, material: Material) -> dict[str, Any]:
        opacity = material.opacity
        if opacity is None:
            return {}
        mode = (
            {"alpha_mode": "BLEND"}
            if opacity.cutoff is None
            else {"alpha_mode": "MASK", "alpha_cutoff": opacity.cutoff}
        )
        if opacity.alpha.size == 1:
            return {"alpha": float(opacity.alpha.ravel()[0]) / 255, **mode}
        key = "alpha", id(opacity.alpha)
        file = self._images.add(f"{material.name} opacity", key, lambda: opacity.alpha[..., None])
        return {"alpha": ImageInput(file, channel="r", wrap=opacity.wrap), **mode}


def emissive_surface(radiance: tuple[float, float, float]) -> SurfaceParameters:
    """Return a black surface that emits light."""
    strength = max(*radiance, 1.0)
    color = rgb(np.array(radiance) / strength)
    black = SurfaceParameters(base_color=(0.0, 0.0, 0.0), specular=0.0)
    return replace(black, emission=color, emission_strength=strength)


def _with_transform(surface: SurfaceParameters, uv: UvTransform | None) -> SurfaceParameters:
    """Return a surface whose images have transformed texture coordinates."""
    if uv is None:
        return surface
    images = {name: value for name, value in vars(surface).items() if isinstance(value, ImageInput)}
    placed: dict[str, Any] = {name: replace(image, transform=uv) for name, image in images.items()}
    return replace(surface, **placed)


def _parameters(layer: Mapping[str, Any], fit: PrincipledFit) -> SurfaceParameters:
    coat = fit.coat
    return SurfaceParameters(
        **layer,
        roughness=fit.surface.roughness,
        anisotropy=coat.anisotropy,
        anisotropy_rotation=fit.turn,
        clearcoat=coat.coat,
        clearcoat_roughness=coat.coat_roughness if coat.coat > 0 else 0.0,
        sheen_color=coat.sheen,
        sheen_roughness=coat.sheen_roughness if any(coat.sheen) else 0.0,
    )


def term_maps(material: Material, terms: Sequence[Mapping[str, Any]]) -> Maps:
    """Textures of the channels that terms use."""
    channels = {texture_channel(term) for term in terms}
    images = dict(zip(("diffuse", "specular"), user_images(terms), strict=True))

    def texture(channel: str) -> Texture | None:
        image = images[channel]
        return load_texture(image) if image is not None else material.textures.get(channel)

    return Maps(*(texture(channel) if channel in channels else None for channel in ("diffuse", "specular")))


def _roughness_map(material: Material, terms: Sequence[Mapping[str, Any]]) -> Texture | None:
    """Roughness over its mean."""
    if not any(map(uses_roughness_map, terms)):
        return None
    image = roughness_image(terms)
    return material.textures.get("roughness") if image is None else load_roughness_map(image)


def at_mean(terms: Sequence[Mapping[str, Any]], texture_means: tuple[F64, F64]) -> list[dict[str, Any]]:
    """Return the terms without textures, their colors multiplied by the mean of their textures.

    Args:
        terms: of a complete look. texture_means: of the channels "diffuse" and "specular".
    """
    means = dict(zip(("diffuse", "specular"), texture_means, strict=True))
    plain = []
    for term in terms:
        channel = texture_channel(term)
        mean = np.ones(3) if channel is None else means[channel]
        color = (np.array(term["color"], np.float64) * mean).tolist()
        plain.append({**term, "color": color, "texture": None, "roughness_map": None})
    return plain


def user_maps(terms: Sequence[Mapping[str, Any]]) -> list[str]:
    """Uploaded images of terms."""
    names = [term.get(field) for term in terms for field in ("texture", "roughness_map")]
    return [name for name in names if is_user_image(name)]


def _volume(glass: Glass | None) -> dict[str, Any]:
    """Parameters of an absorbing solid: transmittance over the distance at which it is 1/e in the darkest channel."""
    if glass is None:
        return {}
    highest = max(glass.absorbed)
    if glass.thickness == 0 or highest <= 0:
        return {"thickness": glass.thickness}
    color = np.exp(-np.array(glass.absorbed) / highest)
    return {"thickness": glass.thickness, "attenuation_distance": 1 / highest, "attenuation_color": rgb(color)}


def _omitted(material: Material, look: MaterialLook, *, is_projected: bool) -> tuple[str, ...]:
    """Sentences about features of a material that no principled surface has."""
    label = f"material {quote(material.name)}"
    glass_roughness = None if material.glass is None else material.glass.roughness
    sentences = {
        f"The {label} is exported as a surface, not as a shadow catcher.": look.shadow_catcher,
        f"Images on {label} need UV coordinates, which its objects lack.": is_projected,
        f"The BTF of {label} is exported as its mean.": any(term["model"] == "measured_btf" for term in look.terms),
        f"Transmitted and reflected light of {label} have one roughness.": _differs(glass_roughness, look),
    }
    return tuple(sentence for sentence, applies in sentences.items() if applies)


def _differs(glass_roughness: float | None, look: MaterialLook) -> bool:
    """True if no highlight has the roughness of the glass."""
    values = [np.mean(term["params"].get("roughness", 0.0)) for term in look.terms if term["model"] == "ggx"]
    return glass_roughness is not None and bool(values) and abs(float(values[0]) - glass_roughness) > 0.01
