"""Materials of other dialects as metallic-roughness with the extensions that have terms.

- KHR_materials_pbrSpecularGlossiness: a dielectric whose f0 is the specular color, by KHR_materials_ior = 0 and
  KHR_materials_specular; roughness = 1 − glossiness.
- KHR_materials_unlit: a matte surface of the base color, which has exactly this color under an even light of 1.
- KHR_materials_coat: a clear coat; its color and index of refraction stay in the extension.
- KHR_materials_fuzz: a sheen, scaled by the weight; the texture of the weight stays in the extension.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from pydantic import BaseModel

from relume.core.import_warnings import ImporterWarning, approximated, unsupported
from relume.scene_io.gltf.document import GltfMaterial as GltfMaterial
from relume.scene_io.gltf.document import MetallicRoughness, TextureInfo
from relume.scene_io.gltf.material_extensions import (
    Clearcoat,
    Coat,
    Fuzz,
    Ior,
    MaterialExtensions,
    Sheen,
    Specular,
    SpecularGlossiness,
)

M = TypeVar("M", bound=BaseModel)


def translate(
    material: GltfMaterial, extensions: MaterialExtensions, label: str, warnings: list[ImporterWarning]
) -> tuple[GltfMaterial, MaterialExtensions]:
    """Return the same material as metallic-roughness with supported extensions.

    Args:
        material, extensions: from the document. label: names the material in warnings.
        warnings: gets a sentence for each difference.
    """
    if extensions.unlit is not None:
        message = f"Unlit on {label} isn't supported; it is matte, with its color under an even light of 1."
        warnings.append(unsupported(message))
        return _matte(material)
    updates: dict[str, Any] = {}
    if (glossy := extensions.pbrSpecularGlossiness) is not None:
        material = material.model_copy(update={"pbrMetallicRoughness": _metallic_roughness(glossy)})
        updates |= {"ior": Ior(ior=0), "specular": _specular(glossy)}
    if (coat := extensions.coat) is not None:
        updates["clearcoat"] = _clearcoat(coat)
        if coat.coatFactor > 0 and (coat.coatDarkeningFactor > 0 or coat.coatAnisotropyStrength > 0):
            warnings.append(approximated(f"The coat of {label} is isotropic and does not darken its base."))
    if (fuzz := extensions.fuzz) is not None:
        updates["sheen"] = _sheen(fuzz)
        warnings.append(approximated(f"The fuzz of {label} is approximated by sheen."))
    return material, extensions.model_copy(update=updates)


def without_textures(model: M, is_usable: Callable[[TextureInfo, str], bool]) -> M:
    """Return a copy without the textures that cannot be used.

    Args:
        model: a material or its extensions. is_usable: of a texture and its property's name.
    """
    updates: dict[str, Any] = {}
    for name, value in model:
        if isinstance(value, TextureInfo):
            updates |= {} if is_usable(value, name) else {name: None}
        elif isinstance(value, BaseModel):
            updates[name] = without_textures(value, is_usable)
    return model.model_copy(update=updates)


def _matte(material: GltfMaterial) -> tuple[GltfMaterial, MaterialExtensions]:
    base = material.pbrMetallicRoughness
    pbr = base.model_copy(update={"metallicFactor": 0.0, "roughnessFactor": 1.0, "metallicRoughnessTexture": None})
    plain = GltfMaterial(
        name=material.name,
        pbrMetallicRoughness=pbr,
        alphaMode=material.alphaMode,
        alphaCutoff=material.alphaCutoff,
        doubleSided=material.doubleSided,
    )
    return plain, MaterialExtensions(specular=Specular(specularFactor=0))


def _metallic_roughness(glossy: SpecularGlossiness) -> MetallicRoughness:
    """Metallic-roughness without the glossiness texture, which is inverted when images are read."""
    is_textured = glossy.specularGlossinessTexture is not None
    return MetallicRoughness(
        baseColorFactor=glossy.diffuseFactor,
        baseColorTexture=glossy.diffuseTexture,
        metallicFactor=0,
        roughnessFactor=1 if is_textured else 1 - glossy.glossinessFactor,
    )


def _specular(glossy: SpecularGlossiness) -> Specular:
    return Specular(specularColorFactor=glossy.specularFactor, specularColorTexture=glossy.specularGlossinessTexture)


def _clearcoat(coat: Coat) -> Clearcoat:
    return Clearcoat(
        clearcoatFactor=coat.coatFactor,
        clearcoatTexture=coat.coatTexture,
        clearcoatRoughnessFactor=coat.coatRoughnessFactor,
        clearcoatRoughnessTexture=coat.coatRoughnessTexture,
        clearcoatNormalTexture=coat.coatNormalTexture,
    )


def _sheen(fuzz: Fuzz) -> Sheen:
    return Sheen(
        sheenColorFactor=[fuzz.fuzzFactor * value for value in fuzz.fuzzColorFactor],
        sheenColorTexture=fuzz.fuzzColorTexture,
        sheenRoughnessFactor=fuzz.fuzzRoughnessFactor,
        sheenRoughnessTexture=fuzz.fuzzRoughnessTexture,
    )
