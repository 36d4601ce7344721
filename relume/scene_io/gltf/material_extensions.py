"""Material extensions as typed models: what the file says beyond metallic-roughness.

Specifications of KHR_materials_ior, _specular, _clearcoat, _sheen, _anisotropy, _emissive_strength,
_transmission and _volume.
"""

from __future__ import annotations

import re
from typing import Annotated, TypeVar

from pydantic import BaseModel, Field, ValidationError

from relume.core.import_warnings import ImporterWarning, unsupported
from relume.scene_io.gltf.document import Extensions, Factor, Number, TextureInfo

Weight = Annotated[float, Field(allow_inf_nan=False, ge=0, le=1e6)]
Weights = Annotated[list[Weight], Field(min_length=3, max_length=3)]
M = TypeVar("M", bound=BaseModel)


class Ior(BaseModel, frozen=True):
    """KHR_materials_ior; 0 stands for a mirror."""

    ior: Weight = 1.5


class Specular(BaseModel, frozen=True):
    """KHR_materials_specular: how much a dielectric reflects, and in which colour head-on."""

    specularFactor: Factor = 1.0  # noqa: N815  (glTF's own spelling, here and below)
    specularTexture: TextureInfo | None = None  # noqa: N815
    specularColorFactor: Weights = [1.0, 1.0, 1.0]  # noqa: N815
    specularColorTexture: TextureInfo | None = None  # noqa: N815


class Clearcoat(BaseModel, frozen=True):
    """KHR_materials_clearcoat: a dielectric film over everything else."""

    clearcoatFactor: Factor = 0.0  # noqa: N815
    clearcoatTexture: TextureInfo | None = None  # noqa: N815
    clearcoatRoughnessFactor: Factor = 0.0  # noqa: N815
    clearcoatRoughnessTexture: TextureInfo | None = None  # noqa: N815
    clearcoatNormalTexture: TextureInfo | None = None  # noqa: N815


class Sheen(BaseModel, frozen=True):
    """KHR_materials_sheen: fibres that scatter at grazing angles."""

    sheenColorFactor: Annotated[list[Factor], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]  # noqa: N815
    sheenColorTexture: TextureInfo | None = None  # noqa: N815
    sheenRoughnessFactor: Factor = 0.0  # noqa: N815
    sheenRoughnessTexture: TextureInfo | None = None  # noqa: N815


class Anisotropy(BaseModel, frozen=True):
    """KHR_materials_anisotropy: the highlight is stretched along the tangent turned by `anisotropyRotation`."""

    anisotropyStrength: Factor = 0.0  # noqa: N815
    anisotropyRotation: Number = 0.0  # noqa: N815
    anisotropyTexture: TextureInfo | None = None  # noqa: N815


class EmissiveStrength(BaseModel, frozen=True):
    """KHR_materials_emissive_strength: multiplies what a material emits."""

    emissiveStrength: Annotated[Number, Field(ge=0)] = 1.0  # noqa: N815


class Transmission(BaseModel, frozen=True):
    """KHR_materials_transmission: the share of light that passes instead of being scattered."""

    transmissionFactor: Factor = 0.0  # noqa: N815
    transmissionTexture: TextureInfo | None = None  # noqa: N815


class Volume(BaseModel, frozen=True):
    """KHR_materials_volume: the surface is the rim of a solid, which absorbs; thickness 0 is a pane."""

    thicknessFactor: Weight = 0.0  # noqa: N815
    attenuationDistance: Annotated[float, Field(gt=0)] = float("inf")  # noqa: N815
    attenuationColor: Annotated[list[Factor], Field(min_length=3, max_length=3)] = [1.0, 1.0, 1.0]  # noqa: N815


class MaterialExtensions(BaseModel, frozen=True):
    """All that relume understands of one material's extensions."""

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
    """A material's extensions as far as they are understood.

    Args:
        extensions: as the document has them.
        label: names the material in warnings.
        warnings: gets a sentence for each extension that is not understood, or is not valid.
    """

    def read(model: type[M]) -> M:
        extension = f"KHR_materials_{re.sub('(?<=.)(?=[A-Z])', '_', model.__name__).lower()}"
        try:
            return model.model_validate(extensions.get(extension, {}))
        except (ValidationError, RecursionError):
            warnings.append(unsupported(f"extension {extension!r} of {label} is not valid; it is not used"))
            return model()

    unread_names = sorted(extensions.keys() - MATERIAL_EXTENSIONS)
    warnings.extend(unsupported(f"extension {extension[:60]!r} of {label} is not used") for extension in unread_names)
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
