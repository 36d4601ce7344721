"""Materials of a GLB file as values of Blender's Principled BSDF.

The server fits each material of a look as one of glTF; the inputs of Blender 4 and newer have the same meanings. Its
specular level is half of glTF's factor.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Value = float | tuple[float, float, float]
Json = Mapping[str, Any]

_BLACK, _WHITE = [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]
_INEXACT = 0.01


def principled_values(material: Json) -> dict[str, Value]:
    """Values of the Principled BSDF by name of the input. Inputs without effect on the material are left out."""
    pbr = material.get("pbrMetallicRoughness", {})
    layers = {name.removeprefix("KHR_materials_"): layer for name, layer in material.get("extensions", {}).items()}
    coat, sheen, specular = (layers.get(name, {}) for name in ("clearcoat", "sheen", "specular"))
    sheen_color = sheen.get("sheenColorFactor", _BLACK)
    sheen_weight = max(sheen_color)
    values: dict[str, Value] = {
        "Base Color": _rgb(pbr.get("baseColorFactor", _WHITE)),
        "Metallic": pbr.get("metallicFactor", 1.0),
        "Roughness": pbr.get("roughnessFactor", 1.0),
        "Coat Weight": coat.get("clearcoatFactor", 0.0),
        "Sheen Weight": sheen_weight,
        "Emission Color": _rgb(material.get("emissiveFactor", _BLACK)),
        "Emission Strength": layers.get("emissive_strength", {}).get("emissiveStrength", 1.0),
        "Anisotropic": layers.get("anisotropy", {}).get("anisotropyStrength", 0.0),
        "Transmission Weight": layers.get("transmission", {}).get("transmissionFactor", 0.0),
    }
    if values["Coat Weight"]:
        values["Coat Roughness"] = coat.get("clearcoatRoughnessFactor", 0.0)
    if sheen_weight > 0:
        values["Sheen Tint"] = _rgb([channel / sheen_weight for channel in sheen_color])
        values["Sheen Roughness"] = sheen.get("sheenRoughnessFactor", 0.0)
    if values["Metallic"] != 1.0:  # a metal does not show them
        values["IOR"] = layers.get("ior", {}).get("ior", 1.5)
        values["Specular IOR Level"] = specular.get("specularFactor", 1.0) / 2
        values["Specular Tint"] = _rgb(specular.get("specularColorFactor", _WHITE))
    if not any(values["Emission Color"]):  # type: ignore[arg-type]
        del values["Emission Color"]
        values["Emission Strength"] = 0.0
    return values


def fit_sentences(material: Json) -> list[str]:
    """Sentences about what a material of an export does not have, with the error of a fit."""
    report = material.get("extras", {}).get("relume", {})
    error, name = report.get("error", 0.0), material.get("name", "")
    fit = f"Material “{name}” is the nearest Principled BSDF, {error:.0%} off."
    return [*([fit] if error > _INEXACT else []), *report.get("omitted", ())]


def _rgb(color: Any) -> tuple[float, float, float]:
    red, green, blue = (float(channel) for channel in color[:3])
    return red, green, blue
