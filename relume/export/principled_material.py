"""Principled parameters of a material's terms, and back: the parameters that artists know, over the same terms.

Terms are made as imports make them (`relume.scene_io.surfaces.make_material`) and read as exports read them
(`relume.export.principled_fit`, `relume.export.base_layer`), so the editor and files in both directions agree.
Textures stay with their terms; parameters are those at their mean, and a change of a color scales its texture.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.roughness_levels import uses_roughness_map
from relume.brdf.symmetry import is_isotropic
from relume.brdf.term_validation import complete_term
from relume.brdf.terms.ggx import GGX
from relume.brdf.terms.sheen import MIN_ROUGHNESS
from relume.core.validation import Pointer, check_number, check_object, check_triple
from relume.export.base_layer import Maps, base_layer
from relume.export.export_images import ExportImages
from relume.export.export_materials import at_mean, term_maps
from relume.export.principled_fit import HIGHLIGHTS, PrincipledFit, fit_principled
from relume.export.surface_values import direction_pairs, term_values
from relume.scene.model import Glass, Material
from relume.scene.validate import MAX_IOR
from relume.scene_io.surfaces.make_material import SurfaceMaterials
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters

Rgb = tuple[float, float, float]
Term = dict[str, Any]
F64 = NDArray[np.float64]
TextureMeans = tuple[Rgb, Rgb]
"""Mean of the texture of the channels "diffuse" and "specular"; ones without a texture."""

EXACT = 1e-4
"""Relative error up to which terms are those of the parameters: both are rounded to six decimals."""
NO_TEXTURES: TextureMeans = ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
_MODELS = {"lambert", "sheen", *HIGHLIGHTS}
_BLACK = 1e-4  # of a texture
_NORMALIZED = 0.02  # deviation of the mean of a normalized texture, by its bytes
_GLASS_TOLERANCE = GGX.parameter("roughness").minimum  # imports clamp the roughness of the highlight alone


@dataclass(frozen=True)
class PrincipledMaterial:
    """Principled parameters. Colors are linear Rec. 709.

    Attributes:
        base_color: albedo of the dielectric, f0 of the metal. metallic: fraction of the metal.
        roughness, coat_roughness, sheen_roughness: perceptual, α = roughness².
        specular, specular_color: factors of the dielectric's reflectance, and of its f0.
        ior: index of refraction. anisotropy: strength, as in KHR_materials_anisotropy.
        coat_weight, sheen_weight: of the layers above. sheen_color: at weight 1.
        transmission: fraction of the light of the diffuse layer that glass transmits; 0 of opaque materials.
    """

    base_color: Rgb = (0.8, 0.8, 0.8)
    metallic: float = 0.0
    roughness: float = 0.5
    specular: float = 1.0
    specular_color: Rgb = (1.0, 1.0, 1.0)
    ior: float = 1.5
    anisotropy: float = 0.0
    coat_weight: float = 0.0
    coat_roughness: float = 0.03
    sheen_weight: float = 0.0
    sheen_color: Rgb = (1.0, 1.0, 1.0)
    sheen_roughness: float = 0.3
    transmission: float = 0.0

    def surface(self) -> SurfaceParameters:
        """The parameters of an import with these values."""
        return SurfaceParameters(
            base_color=self.base_color,
            metallic=self.metallic,
            roughness=self.roughness,
            specular=self.specular,
            specular_color=self.specular_color,
            ior=self.ior,
            anisotropy=self.anisotropy,
            clearcoat=self.coat_weight,
            clearcoat_roughness=self.coat_roughness,
            sheen_color=self.sheen_color,
            sheen_weight=self.sheen_weight,
            sheen_roughness=self.sheen_roughness,
            transmission=self.transmission,
        )


_WIDTH = GGX.parameter("roughness").minimum, GGX.parameter("roughness").maximum
PRINCIPLED_RANGES: dict[str, tuple[float, float]] = {
    **dict.fromkeys(asdict(PrincipledMaterial()), (0.0, 1.0)),
    "roughness": _WIDTH,
    "coat_roughness": _WIDTH,
    "sheen_roughness": (MIN_ROUGHNESS, 1.0),
    "specular_color": (0.0, 10.0),
    "ior": (1.0, MAX_IOR),
}


class PrincipledReading(NamedTuple):
    """The principled parameters of a material.

    Attributes:
        parameters: of the same terms if `reason` is None, otherwise of the closest ones.
        terms, glass: that the parameters make; `glass` is None for an opaque material.
        error: relative RMS error of cosine-weighted BRDF values, at the mean of the textures.
        reason: a sentence if no principled material has these terms.
    """

    parameters: PrincipledMaterial
    terms: list[Term]
    glass: dict[str, Any] | None
    error: float
    reason: str | None


def complete_parameters(pointer: Pointer, given: Any) -> PrincipledMaterial:
    """Return valid parameters; omitted ones have their defaults.

    Args:
        pointer: location, for the error. given: anything.
    Raises:
        ParameterError: something is invalid.
    """
    defaults = asdict(PrincipledMaterial())
    check_object(pointer, given, defaults)
    for name, value in given.items():
        check = check_triple if isinstance(defaults[name], tuple) else check_number
        check((*pointer, name), value, *PRINCIPLED_RANGES[name])
    values: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in given.items()}
    return PrincipledMaterial(**values)


def texture_means(material: Material, terms: Sequence[Mapping[str, Any]]) -> TextureMeans:
    """Return the means of the textures of terms.

    Args:
        material: of the scene, with its textures. terms: of a complete look.
    Raises:
        NotFoundError, SceneError: an image of the terms is unavailable.
    """
    diffuse, specular = term_maps(material, terms).means()
    is_normalized = np.abs(specular - 1).max() < _NORMALIZED
    return _rgb(diffuse), NO_TEXTURES[1] if is_normalized else _rgb(specular)


def principled_terms(
    parameters: PrincipledMaterial,
    terms: Sequence[Mapping[str, Any]],
    glass: Mapping[str, Any] | None = None,
    means: TextureMeans = NO_TEXTURES,
) -> tuple[list[Term], dict[str, Any] | None]:
    """Return the terms and the glass of principled parameters.

    Args:
        parameters: the parameters. terms: the material's own, whose textures stay.
        glass: of its look; None: it is opaque, and transmits nothing. means: of the textures.
    """
    surface = (parameters if glass is not None else replace(parameters, transmission=0.0)).surface()
    material = SurfaceMaterials(_NoImages(), []).make("material", surface).material
    made = [complete_term(("terms", index), term, None) for index, term in enumerate(material.terms)]
    for index, (models, mean) in enumerate(zip(({"lambert"}, HIGHLIGHTS), means, strict=True)):
        own = next((term for term in terms if term["model"] in models), None)
        if own is not None:
            made[index] = _with_textures(made[index], own, mean)
    return made, None if glass is None else {**glass, **_glass_fields(parameters, material.glass)}


def read_principled(
    terms: Sequence[Mapping[str, Any]],
    glass: Mapping[str, Any] | None = None,
    means: TextureMeans = NO_TEXTURES,
) -> PrincipledReading:
    """Return the principled parameters of terms, or the closest ones.

    Args:
        terms: of a complete look. glass: of the look; None if the material is opaque. means: of the textures.
    Raises:
        NotFoundError: measured data of a term do not exist.
    """
    plain = at_mean(terms, (np.array(means[0]), np.array(means[1])))
    parameters = _closest(json.dumps(plain), json.dumps(glass))
    made, made_glass = principled_terms(parameters, terms, glass, means)
    pairs = direction_pairs(is_isotropic=all(map(is_isotropic, (*made, *plain))))
    made_plain = at_mean(made, (np.array(means[0]), np.array(means[1])))
    error = pairs.relative_error(term_values(made_plain, pairs), term_values(plain, pairs))
    is_exact = error <= EXACT and _has_same_maps(made, terms)
    reason = _reason(terms) if not is_exact else None if _is_same_glass(made_glass, glass) else _GLASS_REASON
    return PrincipledReading(parameters, made, made_glass, error, reason)


@lru_cache(maxsize=256)  # materials are selected again and again
def _closest(terms: str, glass: str) -> PrincipledMaterial:
    """The parameters of terms and glass as JSON."""
    fit, fields = fit_principled(json.loads(terms)), json.loads(glass)
    solid = None if fields is None else Glass(tint=_rgb(fields["color"]), ior=fields["ior"])
    layer = base_layer(fit.surface, Maps(), solid, ExportImages(), "material")
    values = {**layer, "roughness": fit.surface.roughness, **_upper_layers(fit)}
    return PrincipledMaterial(**{name: _within_range(name, value) for name, value in values.items()})


def _upper_layers(fit: PrincipledFit) -> dict[str, Any]:
    """Anisotropy, coat and sheen of a fit; layers without weight have the defaults."""
    coat, weight = fit.coat, max(fit.coat.sheen)
    layers: dict[str, Any] = {"anisotropy": coat.anisotropy, "coat_weight": coat.coat, "sheen_weight": weight}
    if coat.coat > 0:
        layers["coat_roughness"] = coat.coat_roughness
    if weight > 0:
        layers |= {"sheen_color": _rgb(np.array(coat.sheen) / weight), "sheen_roughness": coat.sheen_roughness}
    return layers


def _within_range(name: str, value: Any) -> Any:
    clipped = np.round(np.clip(value, *PRINCIPLED_RANGES[name]), 6)
    return _rgb(clipped) if clipped.ndim else float(clipped)


def _with_textures(term: Term, own: Mapping[str, Any], mean: Rgb) -> Term:
    """A term with the texture and roughness map of a material's own; its color without the mean of the texture."""
    if own.get("texture") is not None:
        channels = zip(term["color"], own["color"], mean, strict=True)
        color = [c if m == 1 else round(c / m, 6) if m > _BLACK else previous for c, previous, m in channels]
        term = {**term, "color": color, "texture": own["texture"]}
    has_map = term["model"] == "ggx" and "roughness_map" in own
    return {**term, "roughness_map": own["roughness_map"]} if has_map else term


def _glass_fields(parameters: PrincipledMaterial, glass: Glass | None) -> dict[str, Any]:
    """The fields of a look's glass; black without transmission."""
    color = [0.0, 0.0, 0.0] if glass is None else np.round(glass.tint, 6).tolist()
    return {"color": color, "roughness": parameters.roughness, "ior": parameters.ior}


def _is_same_glass(made: Mapping[str, Any] | None, own: Mapping[str, Any] | None) -> bool:
    if made is None or own is None:
        return True
    is_same_color = np.allclose(made["color"], own["color"], atol=EXACT)
    return is_same_color and abs(made["roughness"] - own["roughness"]) <= _GLASS_TOLERANCE


def _has_same_maps(made: Sequence[Mapping[str, Any]], own: Sequence[Mapping[str, Any]]) -> bool:
    """True if as many terms have a texture and a roughness map."""
    return all(sum(map(has, made)) == sum(map(has, own)) for has in (_has_texture, uses_roughness_map))


def _has_texture(term: Mapping[str, Any]) -> bool:
    return term.get("texture") is not None


_GLASS_REASON = "Its glass has another roughness than its highlight."


def _reason(terms: Sequence[Mapping[str, Any]]) -> str:
    """The reason that no principled material has these terms, a sentence."""
    if any(term.get("data") is not None for term in terms):
        return "It has measured layers."
    if any(term["model"] not in _MODELS for term in terms):
        return "It has layers of other models."
    if any("points" in json.dumps(term["curves"]) or "handles" in json.dumps(term["curves"]) for term in terms):
        return "It has curves drawn by hand."
    return "Its layers are combined in another way."


def _rgb(values: Any) -> Rgb:
    red, green, blue = (round(float(value), 6) for value in values)
    return red, green, blue


class _NoImages:
    """The images of parameters that have none."""

    def pixels(self, file: str, label: str) -> None:
        return None
