"""Materials of a glTF file as surface parameters. glTF 2.0 specification, section 3.9, and those of the extensions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.math.uv_transform import UvTransform
from relume.scene_io.gltf.document import GltfMaterial as GltfMaterial
from relume.scene_io.gltf.document import TextureInfo
from relume.scene_io.gltf.images import ImageReader
from relume.scene_io.gltf.material_dialects import translate, without_textures
from relume.scene_io.gltf.material_extensions import MaterialExtensions, TextureTransform, read_extensions
from relume.scene_io.gltf.tolerant import read_object
from relume.scene_io.surfaces.make_material import NO_COLORS, ReadMaterial, SurfaceMaterials, VertexColors
from relume.scene_io.surfaces.material_textures import TextureLayout
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Color, Rgb, Scalar
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters

_TRANSFORM = "KHR_texture_transform"


class MaterialReader:
    """Converts the materials of one file, with a limit on their texels."""

    def __init__(self, images: ImageReader, warnings: list[ImporterWarning]) -> None:
        self._images, self._warnings = images, warnings
        self._maker = SurfaceMaterials(images, warnings)
        self._surfaces: dict[int, tuple[GltfMaterial, SurfaceParameters]] = {}

    def read(self, material: GltfMaterial, colors: VertexColors = NO_COLORS) -> ReadMaterial:
        """Convert one material, with a unique name.

        Args:
            material: from the document. colors: vertex colors of its meshes.
        Raises:
            SceneError: there are too many texels.
        """
        return self._maker.make(material.name, self._surface(material), colors, double_sided=material.doubleSided)

    def texture_layout(self, material: GltfMaterial) -> TextureLayout | None:
        """Find where the textures of a material are; None if it has none that are used as images."""
        return self._maker.texture_layout(material.name, self._surface(material))

    def warn_occlusion_maps(self) -> None:
        """Add one warning for the occlusion textures of all materials that were read."""
        self._maker.warn_occlusion_maps()

    def _surface(self, material: GltfMaterial) -> SurfaceParameters:
        """The parameters of a material, without the textures that cannot be read."""
        if id(material) not in self._surfaces:
            label = f"material {quote(material.name or 'material')}"
            extensions = read_extensions(material.extensions, label, self._warnings)
            translated, extensions = translate(material, extensions, label, self._warnings)

            def is_usable(info: TextureInfo, name: str) -> bool:
                return name == "occlusionTexture" or self._images.is_usable(info.index, f"the {name} of {label}")

            usable = without_textures(translated, is_usable), without_textures(extensions, is_usable)
            surface = _Textures(self._images, label, self._warnings).surface(*usable)
            self._surfaces[id(material)] = material, surface  # the material, too, so that its id stays its own
        return self._surfaces[id(material)][1]


class _Textures:
    """The textures of one material as images."""

    def __init__(self, images: ImageReader, label: str, warnings: list[ImporterWarning]) -> None:
        self._images, self._label, self._warnings = images, label, warnings
        self._transforms: dict[int, tuple[int, UvTransform]] = {}

    def surface(self, material: GltfMaterial, extensions: MaterialExtensions) -> SurfaceParameters:
        """The parameters of a material whose textures can be used."""
        pbr, specular, coat = material.pbrMetallicRoughness, extensions.specular, extensions.clearcoat
        tinted, sheen, fuzz = extensions.coat, extensions.sheen, extensions.fuzz
        anisotropy, volume, glossy = extensions.anisotropy, extensions.volume, extensions.pbrSpecularGlossiness
        transmission = extensions.transmission
        roughness = self._number(pbr.roughnessFactor, pbr.metallicRoughnessTexture, "g")
        if glossy is not None:
            roughness = self._roughness(glossy.glossinessFactor, glossy.specularGlossinessTexture)
        return SurfaceParameters(
            base_color=self._color(pbr.baseColorFactor, pbr.baseColorTexture),
            metallic=self._number(pbr.metallicFactor, pbr.metallicRoughnessTexture, "b"),
            roughness=roughness,
            specular=self._number(specular.specularFactor, specular.specularTexture, "a"),
            specular_color=self._color(specular.specularColorFactor, specular.specularColorTexture),
            ior=extensions.ior.ior,
            has_f0=glossy is not None,
            anisotropy=anisotropy.anisotropyStrength,
            anisotropy_rotation=anisotropy.anisotropyRotation,
            anisotropy_map=self._image(anisotropy.anisotropyTexture),
            clearcoat=self._number(coat.clearcoatFactor, coat.clearcoatTexture, "r"),
            clearcoat_roughness=self._number(coat.clearcoatRoughnessFactor, coat.clearcoatRoughnessTexture, "g"),
            clearcoat_ior=1.5 if tinted is None else tinted.coatIor,
            clearcoat_color=(
                (1.0, 1.0, 1.0) if tinted is None else self._color(tinted.coatColorFactor, tinted.coatColorTexture)
            ),
            has_clearcoat_normal=coat.clearcoatNormalTexture is not None,
            sheen_color=self._color(sheen.sheenColorFactor, sheen.sheenColorTexture),
            sheen_weight=1.0 if fuzz is None else self._number(1.0, fuzz.fuzzTexture, "r"),
            sheen_roughness=self._number(sheen.sheenRoughnessFactor, sheen.sheenRoughnessTexture, "a"),
            transmission=self._number(transmission.transmissionFactor, transmission.transmissionTexture, "r"),
            thickness=volume.thicknessFactor,
            attenuation_distance=volume.attenuationDistance,
            attenuation_color=_rgb(volume.attenuationColor),
            emission=self._color(np.maximum(material.emissiveFactor, 0).tolist(), material.emissiveTexture),
            emission_strength=extensions.emissive_strength.emissiveStrength,
            alpha=self._number(pbr.baseColorFactor[3], pbr.baseColorTexture, "a"),
            alpha_mode=material.alphaMode,
            alpha_cutoff=material.alphaCutoff,
            normal=self._normal(material.normalTexture),
            has_occlusion=material.occlusionTexture is not None,
        )

    def _image(
        self, info: TextureInfo | None, channel: str = "rgb", factor: Rgb = (1.0, 1.0, 1.0), *, is_srgb: bool = False
    ) -> ImageInput | None:
        if info is None:
            return None
        uv_set, transform = self._placement(info)
        wrap = self._images.wrap(info.index, self._label)
        return ImageInput(str(info.index), channel, is_srgb, factor, wrap=wrap, uv_set=uv_set, transform=transform)

    def _number(self, factor: float, info: TextureInfo | None, channel: str) -> Scalar:
        image = self._image(info, channel, (factor, factor, factor))
        return factor if image is None else image

    def _color(self, factor: Sequence[float], info: TextureInfo | None) -> Color:
        image = self._image(info, "rgb", _rgb(factor), is_srgb=True)
        return _rgb(factor) if image is None else image

    def _roughness(self, glossiness: float, info: TextureInfo | None) -> Scalar:
        """Roughness of 1 − glossiness."""
        image = self._image(info, "a", (-glossiness, -glossiness, -glossiness))
        return 1 - glossiness if image is None else replace(image, bias=(1.0, 1.0, 1.0))

    def _normal(self, info: TextureInfo | None) -> ImageInput | None:
        """Vectors 2 t − 1 of texels t, with x and y scaled."""
        scale = 1.0 if info is None else info.scale
        image = self._image(info, "rgb", (2 * scale, 2 * scale, 2.0))
        return None if image is None else replace(image, bias=(-scale, -scale, -1.0))

    def _placement(self, info: TextureInfo) -> tuple[int, UvTransform]:
        """UV set and transform of a texture."""
        if id(info) not in self._transforms:
            self._transforms[id(info)] = self._read_placement(info)
        return self._transforms[id(info)]

    def _read_placement(self, info: TextureInfo) -> tuple[int, UvTransform]:
        extension = info.extensions.get(_TRANSFORM)
        if extension is None:
            return info.texCoord, UvTransform()
        try:
            read = read_object(TextureTransform, extension, f"a texture transform of {self._label}", self._warnings)
        except SceneError as problem:
            self._warnings.append(unsupported(f"Ignored a texture transform: {problem}."))
            return info.texCoord, UvTransform()
        uv_set = info.texCoord if read.texCoord is None else read.texCoord
        return uv_set, UvTransform(read.offset, read.rotation, read.scale)


def _rgb(numbers: Sequence[float]) -> Rgb:
    red, green, blue = numbers[:3]
    return red, green, blue
