"""A glTF material in numbers, and the terms that stand for it.

Base: lambert times the mean of (1 - F) of what is not metal, and ggx, F = f90 · schlick(f0 / f90). Anisotropic:
ashikhmin_shirley instead of ggx, its exponents from the widths of the facet distribution, n = 2/α² - 2 (Walter 2007,
section 5.2). Clearcoat: a second ggx. What lies under a coat is dimmed by what that reflects towards the viewer, by a
factor on its curve of θo; what lies under a sheen on that of θi, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.basis.bands import band_averages
from relume.brdf.fresnel import schlick
from relume.brdf.mirror import SOFT
from relume.brdf.registry import TERMS
from relume.brdf.term import Term
from relume.scene.gltf.sheen import below_sheen, sheen_term
from relume.scene.model import Texture

F64 = NDArray[np.float64]
COAT_F0 = 0.04
_MEAN_RISE = 0.0036845  # of (1 - cos θd)^5 over both hemispheres, each weighted by its cosine
Terms = tuple[dict[str, Any], ...]


@dataclass(frozen=True)
class Surface:
    """What lies under coat and sheen.

    Attributes:
        diffuse: albedo. f0, f90: reflectance head-on and at the horizon. (3,), (3,), one
        roughness: as artists know it.
        reflected: mean share that what is not metal reflects before light comes to what scatters it.
        textures: multipliers of the two terms, and of the roughness.
        has_normal_map: which makes it rougher where it is seen from far, see `relume.scene.roughness`.
    """

    diffuse: F64
    f0: F64
    f90: float
    roughness: float
    reflected: float = 0.0
    textures: dict[str, Texture] = field(default_factory=dict)
    has_normal_map: bool = False


@dataclass(frozen=True)
class Over:
    """What changes or covers the surface: strength of anisotropy; weight and roughness of the coat; the sheen's."""

    anisotropy: float = 0.0
    coat: float = 0.0
    coat_roughness: float = 0.0
    sheen: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sheen_roughness: float = 0.0


def make_terms(surface: Surface, over: Over) -> Terms:
    """The terms of a look, bottom up: diffuse, highlight, sheen, coat."""
    textures = {channel: channel if channel in surface.textures else None for channel in ("diffuse", "specular")}
    layers = [
        {
            "model": "lambert",
            "color": _rounded(surface.diffuse * (1 - surface.reflected)),
            "texture": textures["diffuse"],
        },
        _highlight(surface, over.anisotropy) | {"texture": textures["specular"]},
    ]
    if any(over.sheen):
        layers = [_below_sheen(layer, over) for layer in layers]
        layers.append(sheen_term(over.sheen, over.sheen_roughness))
    if over.coat > 0:
        params = _within(TERMS["ggx"], roughness=over.coat_roughness, f0=COAT_F0)
        layers = [
            _dimmed(layer, "theta_o", lambda angle: 1 - over.coat * schlick(np.cos(angle), COAT_F0)) for layer in layers
        ]
        layers.append({"model": "ggx", "color": [over.coat] * 3, "params": params, "texture": None})
    return tuple(layers)


def dielectric_share(f0: float, f90: float) -> float:
    """Mean reflectance of a dielectric by Schlick's F(θd) from f0 head-on to f90 at the horizon."""
    return f0 + (f90 - f0) * _MEAN_RISE


def _highlight(surface: Surface, anisotropy: float) -> dict[str, Any]:
    color = _rounded(np.full(3, surface.f90))
    f0 = surface.f0 / surface.f90 if surface.f90 > 0 else surface.f0
    if anisotropy == 0:
        params = _within(TERMS["ggx"], roughness=surface.roughness, f0=f0)
        widens = surface.has_normal_map and surface.roughness >= SOFT  # mirrors are pictures, which nothing widens
        follows = {"roughness_map": True} if "roughness" in surface.textures or widens else {}
        return {"model": "ggx", "color": color, "params": params, **follows}
    across = max(surface.roughness**2, 1e-3)
    along = across + (1 - across) * anisotropy**2
    params = _within(TERMS["ashikhmin_shirley"], nu=2 / along**2 - 2, nv=2 / across**2 - 2, f0=f0)
    return {"model": "ashikhmin_shirley", "color": color, "params": params}


def _within(term: Term, **values: Any) -> dict[str, Any]:
    """Parameters held to their ranges."""
    held = {}
    for name, value in values.items():
        parameter = term.parameter(name)
        clipped = np.round(np.clip(value, parameter.minimum, parameter.maximum), 6)
        held[name] = clipped.tolist()
    return held


def _below_sheen(layer: dict[str, Any], over: Over) -> dict[str, Any]:
    """What a layer sends through a sheen."""
    by_light = any(curve.name == "theta_i" for curve in TERMS[layer["model"]].curves)
    light, view = below_sheen(max(over.sheen), over.sheen_roughness, by_light=by_light)
    layer = _dimmed(layer, "theta_i", light) if by_light else layer
    return _dimmed(layer, "theta_o", view)


def _dimmed(layer: dict[str, Any], name: str, kept: Callable[[F64], F64]) -> dict[str, Any]:
    """A layer with a curve of which this share is kept."""
    num_bands = TERMS[layer["model"]].curve(name).num_bands
    keep = band_averages(lambda theta: np.clip(kept(theta), 0, 1), num_bands)
    curves = layer.get("curves", {})
    drawn = curves.get(name, {"factors": [1.0] * num_bands, "channels": "rgb"})
    kind = "bands" if "bands" in drawn else "factors"
    return layer | {"curves": {**curves, name: {**drawn, kind: np.round(np.array(drawn[kind]) * keep, 6).tolist()}}}


def _rounded(color: Any) -> list[float]:
    return [round(float(value), 6) for value in color]
