"""Material extensions beyond metallic-roughness as typed models.

Specifications of KHR_materials_ior, _specular, _clearcoat, _coat, _sheen, _fuzz, _anisotropy, _emissive_strength,
_transmission, _volume, _unlit and _pbrSpecularGlossiness.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, Field

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene_io.gltf.document import Extensions, Factor, Index, Number, TextureInfo
from relume.scene_io.gltf.tolerant import read_object

Color = Annotated[list[Factor], Field(min_length=3, max_length=3)]
Weight = Annotated[float, Field(allow_inf_nan=False, ge=0, le=1e6)]
Weights = Annotated[list[Weight], Field(min_length=3, max_length=3)]


class TextureTransform(BaseModel, frozen=True):
    """KHR_texture_transform of one texture; `texCoord` overrides the set."""

    offset: tuple[Number, Number] = (0.0, 0.0)
    rotation: Number = 0.0
    scale: tuple[Number, Number] = (1.0, 1.0)
    texCoord: Index | None = None  # noqa: N815  (glTF's own spelling, here and below)


class Ior(BaseModel, frozen=True):
    """KHR_materials_ior; 0 means a mirror."""

    ior: Annotated[float, Field(allow_inf_nan=False, gt=-1e-6, le=1e6)] = 1.5


class Specular(BaseModel, frozen=True):
    """KHR_materials_specular: reflectance of a dielectric, and its color at normal incidence."""

    specularFactor: Factor = 1.0  # noqa: N815
    specularTexture: TextureInfo | None = None  # noqa: N815
    specularColorFactor: Weights = [1.0, 1.0, 1.0]  # noqa: N815
    specularColorTexture: TextureInfo | None = None  # noqa: N815


class Clearcoat(BaseModel, frozen=True):
    """KHR_materials_clearcoat: a dielectric layer on top of the material."""

    clearcoatFactor: Factor = 0.0  # noqa: N815
    clearcoatTexture: TextureInfo | None = None  # noqa: N815
    clearcoatRoughnessFactor: Factor = 0.0  # noqa: N815
    clearcoatRoughnessTexture: TextureInfo | None = None  # noqa: N815
    clearcoatNormalTexture: TextureInfo | None = None  # noqa: N815


class Sheen(BaseModel, frozen=True):
    """KHR_materials_sheen: fibers that scatter at grazing angles."""

    sheenColorFactor: Color = [0.0, 0.0, 0.0]  # noqa: N815
    sheenColorTexture: TextureInfo | None = None  # noqa: N815
    sheenRoughnessFactor: Factor = 0.0  # noqa: N815
    sheenRoughnessTexture: TextureInfo | None = None  # noqa: N815


class Anisotropy(BaseModel, frozen=True):
    """KHR_materials_anisotropy: a highlight stretched along the tangent, rotated by `anisotropyRotation`."""

    anisotropyStrength: Factor = 0.0  # noqa: N815
    anisotropyRotation: Number = 0.0  # noqa: N815
    anisotropyTexture: TextureInfo | None = None  # noqa: N815


class EmissiveStrength(BaseModel, frozen=True):
    """KHR_materials_emissive_strength: a factor on a material's emission."""

    emissiveStrength: Annotated[Number, Field(ge=0)] = 1.0  # noqa: N815


class Transmission(BaseModel, frozen=True):
    """KHR_materials_transmission: fraction of the light that is transmitted instead of scattered."""

    transmissionFactor: Factor = 0.0  # noqa: N815
    transmissionTexture: TextureInfo | None = None  # noqa: N815


class Volume(BaseModel, frozen=True):
    """KHR_materials_volume: the surface bounds an absorbing solid; thickness 0 is a thin pane."""

    thicknessFactor: Weight = 0.0  # noqa: N815
    attenuationDistance: Annotated[float, Field(gt=0)] = float("inf")  # noqa: N815
    attenuationColor: Color = [1.0, 1.0, 1.0]  # noqa: N815


class Coat(BaseModel, frozen=True):
    """KHR_materials_coat: a clear coat with a color and an index of refraction."""

    coatFactor: Factor = 0.0  # noqa: N815
    coatTexture: TextureInfo | None = None  # noqa: N815
    coatRoughnessFactor: Factor = 0.0  # noqa: N815
    coatRoughnessTexture: TextureInfo | None = None  # noqa: N815
    coatNormalTexture: TextureInfo | None = None  # noqa: N815
    coatIor: Annotated[float, Field(allow_inf_nan=False, ge=1, le=1e6)] = 1.5  # noqa: N815
    coatColorFactor: Color = [1.0, 1.0, 1.0]  # noqa: N815
    coatColorTexture: TextureInfo | None = None  # noqa: N815
    coatDarkeningFactor: Factor = 0.0  # noqa: N815
    coatAnisotropyStrength: Factor = 0.0  # noqa: N815


class Fuzz(BaseModel, frozen=True):
    """KHR_materials_fuzz: fibers on top of everything else."""

    fuzzFactor: Factor = 0.0  # noqa: N815
    fuzzTexture: TextureInfo | None = None  # noqa: N815
    fuzzColorFactor: Color = [1.0, 1.0, 1.0]  # noqa: N815
    fuzzColorTexture: TextureInfo | None = None  # noqa: N815
    fuzzRoughnessFactor: Factor = 0.5  # noqa: N815
    fuzzRoughnessTexture: TextureInfo | None = None  # noqa: N815


class SpecularGlossiness(BaseModel, frozen=True):
    """KHR_materials_pbrSpecularGlossiness, in place of metallic-roughness."""

    diffuseFactor: Annotated[list[Factor], Field(min_length=4, max_length=4)] = [1.0, 1.0, 1.0, 1.0]  # noqa: N815
    diffuseTexture: TextureInfo | None = None  # noqa: N815
    specularFactor: Color = [1.0, 1.0, 1.0]  # noqa: N815
    glossinessFactor: Factor = 1.0  # noqa: N815
    specularGlossinessTexture: TextureInfo | None = None  # noqa: N815


class Unlit(BaseModel, frozen=True):
    """KHR_materials_unlit: the base color, whatever the light."""


class MaterialExtensions(BaseModel, frozen=True):
    """All supported extensions of one material; None for those whose presence matters."""

    ior: Ior = Ior()
    specular: Specular = Specular()
    clearcoat: Clearcoat = Clearcoat()
    coat: Coat | None = None
    sheen: Sheen = Sheen()
    fuzz: Fuzz | None = None
    anisotropy: Anisotropy = Anisotropy()
    emissive_strength: EmissiveStrength = EmissiveStrength()
    transmission: Transmission = Transmission()
    volume: Volume = Volume()
    unlit: Unlit | None = None
    pbrSpecularGlossiness: SpecularGlossiness | None = None  # noqa: N815


MODELS: dict[str, type[BaseModel]] = {
    "ior": Ior,
    "specular": Specular,
    "clearcoat": Clearcoat,
    "coat": Coat,
    "sheen": Sheen,
    "fuzz": Fuzz,
    "anisotropy": Anisotropy,
    "emissive_strength": EmissiveStrength,
    "transmission": Transmission,
    "volume": Volume,
    "unlit": Unlit,
    "pbrSpecularGlossiness": SpecularGlossiness,
}
PREFIX = "KHR_materials_"
MATERIAL_EXTENSIONS = {PREFIX + name for name in MODELS}
DIFFERENCES = {
    "iridescence": "its highlight has no interference colors",
    "diffuse_transmission": "no diffuse light passes through it",
    "diffuse_roughness": "its diffuse reflection is Lambert's",
    "dispersion": "it refracts all colors alike",
    "volume_scatter": "light is not scattered inside it",
    "scatter": "light is not scattered inside it",
    "subsurface": "light is not scattered inside it",
}
"""Known extensions without a term: what is different."""


def read_extensions(extensions: Extensions, label: str, warnings: list[ImporterWarning]) -> MaterialExtensions:
    """Read the supported extensions of a material.

    Args:
        extensions: from the document.
        label: names the material in warnings.
        warnings: gets a sentence for each extension that is unsupported or invalid.
    """
    values: dict[str, Any] = {}
    for extension in sorted(extensions):
        feature = extension.removeprefix(PREFIX)
        if extension not in MATERIAL_EXTENSIONS:
            is_material = feature != extension and feature.isidentifier() and len(feature) <= 60
            name = (
                feature[0].upper() + feature[1:].replace("_", " ") if is_material else f"Extension {quote(extension)}"
            )
            difference = DIFFERENCES.get(feature, "it may look different")
            warnings.append(unsupported(f"{name} on {label} isn't supported; {difference}."))
            continue
        try:
            values[feature] = read_object(MODELS[feature], extensions[extension], f"{extension} of {label}", warnings)
        except SceneError as problem:
            warnings.append(unsupported(f"An extension was left out: {problem}."))
    return MaterialExtensions(**values)
