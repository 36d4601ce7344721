"""Material extensions beyond metallic-roughness as typed models.

Specifications of KHR_materials_ior, _specular, _clearcoat, _sheen, _anisotropy, _emissive_strength,
_transmission and _volume.
"""

from __future__ import annotations

import re
from typing import Annotated, TypeVar

from pydantic import BaseModel, Field, ValidationError

from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene_io.gltf.document import Extensions, Factor, Number, TextureInfo

Weight = Annotated[float, Field(allow_inf_nan=False, ge=0, le=1e6)]
Weights = Annotated[list[Weight], Field(min_length=3, max_length=3)]
M = TypeVar("M", bound=BaseModel)


class Ior(BaseModel, frozen=True):
    """KHR_materials_ior; 0 means a mirror."""

    ior: Weight = 1.5


class Specular(BaseModel, frozen=True):
    """KHR_materials_specular: reflectance of a dielectric, and its color at normal incidence."""

    specularFactor: Factor = 1.0  # noqa: N815  (glTF's own spelling, here and below)
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

    sheenColorFactor: Annotated[list[Factor], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]  # noqa: N815
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
    attenuationColor: Annotated[list[Factor], Field(min_length=3, max_length=3)] = [1.0, 1.0, 1.0]  # noqa: N815


class MaterialExtensions(BaseModel, frozen=True):
    """All supported extensions of one material."""

    ior: Ior = Ior()
    specular: Specular = Specular()
    clearcoat: Clearcoat = Clearcoat()
    sheen: Sheen = Sheen()
    anisotropy: Anisotropy = Anisotropy()
    emissive_strength: EmissiveStrength = EmissiveStrength()
    transmission: Transmission = Transmission()
    volume: Volume = Volume()


MATERIAL_EXTENSIONS = {f"KHR_materials_{name}" for name in MaterialExtensions.model_fields}


def read_extensions(extensions: Extensions, label: str, warnings: list[ImporterWarning]) -> MaterialExtensions:
    """Read the supported extensions of a material.

    Args:
        extensions: from the document.
        label: names the material in warnings.
        warnings: gets a sentence for each extension that is unsupported or invalid.
    """

    def read(model: type[M]) -> M:
        extension = f"KHR_materials_{re.sub('(?<=.)(?=[A-Z])', '_', model.__name__).lower()}"
        try:
            return model.model_validate(extensions.get(extension, {}))
        except (ValidationError, RecursionError):
            warnings.append(unsupported(f"Ignored {extension} of {label}: it is invalid."))
            return model()

    for extension in sorted(extensions.keys() - MATERIAL_EXTENSIONS):
        feature = extension[:60].removeprefix("KHR_materials_")
        is_material = feature != extension[:60] and feature.isidentifier()
        name = feature[0].upper() + feature[1:].replace("_", " ") if is_material else f"Extension {quote(extension)}"
        effect = "it is lit like any other material" if feature == "unlit" else "it may look different"
        warnings.append(unsupported(f"{name} on {label} isn't supported; {effect}."))
    return MaterialExtensions(
        ior=read(Ior),
        specular=read(Specular),
        clearcoat=read(Clearcoat),
        sheen=read(Sheen),
        anisotropy=read(Anisotropy),
        emissive_strength=read(EmissiveStrength),
        transmission=read(Transmission),
        volume=read(Volume),
    )
