"""Conversion of a glTF material to terms.

Base: lambert times the mean of (1 - F) of the dielectric, and ggx, F = f90 · schlick(f0 / f90). Anisotropic:
ashikhmin_shirley instead of ggx, with exponents from the widths of the microfacet distribution, n = 2/α² - 2 (Walter
2007, section 5.2). Clearcoat: a second ggx. The curves of θo of the layers below are attenuated by the reflectance of
the coat toward the viewer; below a sheen, also the curves of θi.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.fresnel import schlick
from relume.brdf.registry import TERMS
from relume.brdf.specular import SOFT
from relume.brdf.term import Term
from relume.brdf.texture_slots import ROUGHNESS
from relume.math.angle_bands import band_averages
from relume.scene.model import Texture
from relume.scene_io.surfaces.sheen import sheen_attenuation, sheen_term

F64 = NDArray[np.float64]
COAT_F0 = 0.04
_COS_82 = 1 / 7
_MEAN_RISE = 0.0036845  # mean of (1 - cos θd)^5 over both hemispheres, cosine-weighted
Terms = tuple[dict[str, Any], ...]
Reflectance = TypeVar("Reflectance", float, NDArray[np.float32])


@dataclass(frozen=True)
class PbrSurface:
    """The base layer, below coat and sheen.

    Attributes:
        diffuse: albedo. f0, f90: reflectance at normal and at grazing incidence.
        roughness: perceptual, α = roughness².
        specular_reflectance: mean specular reflectance of the dielectric, which reduces its diffuse reflection.
        textures: multipliers of the two terms, and of the roughness.
        edge_loss: coefficient a of the reflectance F - a cos θd (1 - cos θd)⁶, see `f82_coefficient`.
        has_normal_map: minification increases the roughness, see `relume.scene.roughness_levels`.
    """

    diffuse: Shaped[F64, " 3"]
    f0: Shaped[F64, " 3"]
    f90: float
    roughness: float
    specular_reflectance: float = 0.0
    textures: dict[str, Texture] = field(default_factory=dict)
    edge_loss: Shaped[F64, " 3"] = field(default_factory=lambda: np.zeros(3))
    has_normal_map: bool = False


@dataclass(frozen=True)
class CoatLayer:
    """Modifications of the base layer: strength of anisotropy; weight and roughness of the coat; the sheen's.

    Attributes:
        coat_f0: reflectance of the coat at normal incidence. coat_color: of light that passes the coat twice.
    """

    anisotropy: float = 0.0
    coat: float = 0.0
    coat_roughness: float = 0.0
    sheen: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sheen_roughness: float = 0.0
    coat_f0: float = COAT_F0
    coat_color: tuple[float, float, float] = (1.0, 1.0, 1.0)


def make_terms(surface: PbrSurface, coat_layer: CoatLayer) -> Terms:
    """Return the terms of a material from bottom to top: diffuse, highlight, sheen, coat."""
    textures = {channel: channel if channel in surface.textures else None for channel in ("diffuse", "specular")}
    layers = [
        {
            "model": "lambert",
            "color": _round_color(surface.diffuse * (1 - surface.specular_reflectance)),
            "texture": textures["diffuse"],
        },
        _with_edge_tint(_highlight(surface, coat_layer.anisotropy), surface) | {"texture": textures["specular"]},
    ]
    if any(coat_layer.sheen):
        layers = [_attenuate_below_sheen(layer, coat_layer) for layer in layers]
        layers.append(sheen_term(coat_layer.sheen, coat_layer.sheen_roughness))
    if coat_layer.coat > 0:
        f0 = coat_layer.coat_f0
        params = _clamp_params(TERMS["ggx"], roughness=coat_layer.coat_roughness, f0=f0)
        layers = [
            _attenuate(layer, "theta_o", lambda angle: 1 - coat_layer.coat * schlick(np.cos(angle), f0))
            | {"color": _round_color(np.array(layer["color"]) * coat_layer.coat_color)}
            for layer in layers
        ]
        layers.append({"model": "ggx", "color": [coat_layer.coat] * 3, "params": params, "texture": None})
    return tuple(layers)


def f82_coefficient(f0: Shaped[F64, " 3"], tint: Shaped[F64, " 3"]) -> Shaped[F64, " 3"]:
    """Coefficient a of Schlick's F minus a cos θ (1 - cos θ)⁶, which is tint F at cos θ = 1/7 (82°).

    Kutz et al. 2021, "Novel aspects of the Adobe Standard Material", and OpenPBR Surface 1.1, section 3.6.

    Args:
        f0: of a metal. tint: in [0, 1].
    """
    return np.asarray(schlick(np.array(_COS_82), f0) * (1 - tint) / _edge(_COS_82))


def _edge(cosine: Any) -> Any:
    return cosine * (1 - cosine) ** 6


def _with_edge_tint(layer: dict[str, Any], surface: PbrSurface) -> dict[str, Any]:
    """A highlight times the reflectance with an edge tint over Schlick's, for each color channel."""
    if not surface.edge_loss.any():
        return layer

    def relative(theta: F64, f0: float, loss: float) -> F64:
        cosine = np.cos(theta)
        reflectance = f0 + (surface.f90 - f0) * (1 - cosine) ** 5
        return np.asarray(np.clip(1 - loss * _edge(cosine) / np.maximum(reflectance, 1e-6), 0, 1))

    num_bands, curves = TERMS[layer["model"]].curve("theta_d").num_bands, list[dict[str, Any]]()
    for channel, f0, loss in zip("rgb", surface.f0.tolist(), surface.edge_loss.tolist(), strict=True):
        factors = band_averages(partial(relative, f0=f0, loss=loss), num_bands)
        curves.append({"factors": np.round(factors, 6).tolist(), "channels": channel})
    return layer | {"curves": {"theta_d": curves}}


def dielectric_reflectance(f0: Reflectance, f90: Reflectance) -> Reflectance:
    """Mean reflectance of a dielectric with Schlick's F(θd) from f0 to f90."""
    return f0 + (f90 - f0) * _MEAN_RISE


def _highlight(surface: PbrSurface, anisotropy: float) -> dict[str, Any]:
    color = _round_color(np.full(3, surface.f90))
    f0 = surface.f0 / surface.f90 if surface.f90 > 0 else surface.f0
    if anisotropy == 0:
        params = _clamp_params(TERMS["ggx"], roughness=surface.roughness, f0=f0)
        # mirrors are traced, and normals do not widen their reflections
        needs_roughness_map = surface.has_normal_map and surface.roughness >= SOFT
        roughness_map = {"roughness_map": ROUGHNESS} if "roughness" in surface.textures or needs_roughness_map else {}
        return {"model": "ggx", "color": color, "params": params, **roughness_map}
    across = max(surface.roughness**2, 1e-3)
    along = across + (1 - across) * anisotropy**2
    params = _clamp_params(TERMS["ashikhmin_shirley"], nu=2 / along**2 - 2, nv=2 / across**2 - 2, f0=f0)
    return {"model": "ashikhmin_shirley", "color": color, "params": params}


def _clamp_params(term: Term, **values: Any) -> dict[str, Any]:
    """Clamp parameters to their ranges."""
    params = {}
    for name, value in values.items():
        parameter = term.parameter(name)
        clipped = np.round(np.clip(value, parameter.minimum, parameter.maximum), 6)
        params[name] = clipped.tolist()
    return params


def _attenuate_below_sheen(layer: dict[str, Any], coat_layer: CoatLayer) -> dict[str, Any]:
    """Attenuate a layer below a sheen."""
    by_light = any(curve.name == "theta_i" for curve in TERMS[layer["model"]].curves)
    light, view = sheen_attenuation(max(coat_layer.sheen), coat_layer.sheen_roughness, by_light=by_light)
    layer = _attenuate(layer, "theta_i", light) if by_light else layer
    return _attenuate(layer, "theta_o", view)


def _attenuate(layer: dict[str, Any], name: str, attenuation: Callable[[F64], F64]) -> dict[str, Any]:
    """Multiply a curve of a layer by an attenuation."""
    num_bands = TERMS[layer["model"]].curve(name).num_bands
    factors = band_averages(lambda theta: np.clip(attenuation(theta), 0, 1), num_bands)
    curves = layer.get("curves", {})
    curve = curves.get(name, {"factors": [1.0] * num_bands, "channels": "rgb"})
    kind = "bands" if "bands" in curve else "factors"
    return layer | {"curves": {**curves, name: {**curve, kind: np.round(np.array(curve[kind]) * factors, 6).tolist()}}}


def _round_color(color: Any) -> list[float]:
    return [round(float(value), 6) for value in color]
