"""Materials of the unedited still life."""

from __future__ import annotations

from typing import Any

from relume.scene.examples.still_life.wood import wood
from relume.scene.model import Material


def _diffuse(*color: float, texture: str | None = None) -> dict[str, Any]:
    return {"model": "lambert", "color": list(color)} | ({"texture": texture} if texture else {})


def _gloss(model: str, color: list[float], **params: Any) -> dict[str, Any]:
    return {"model": model, "color": color, "params": params}


WHITE = [1.0, 1.0, 1.0]
BRASS_F0 = [0.91, 0.70, 0.34]
TERMS: dict[str, tuple[dict[str, Any], ...]] = {
    "Teapot": (
        _diffuse(0.240, 0.016, 0.012),
        _gloss("ashikhmin_shirley", WHITE, nu=300.0, nv=1500.0, f0=0.07),
    ),
    "Tray": (
        _diffuse(*WHITE, texture="diffuse"),
        _gloss("cook_torrance", [0.8, 0.8, 0.8], sigma=0.16, ior=1.5, extinction=0.0),
    ),
    "Handles": (_gloss("ggx", WHITE, roughness=0.36, f0=BRASS_F0),),
    "Pearls": (
        _diffuse(0.66, 0.585, 0.51),
        _gloss("cook_torrance", [1.0, 0.95, 0.92], sigma=0.085, ior=1.68, extinction=0.0),
    ),
    "Bowl": (_diffuse(0.21, 0.33, 0.29), _gloss("ggx", WHITE, roughness=0.26, f0=0.045)),
    "Cloth": (_diffuse(0.085, 0.130, 0.195), _gloss("blinn_phong", [0.030, 0.030, 0.032], exponent=6.0)),
    "Table": (_diffuse(0.066, 0.058, 0.051), _gloss("blinn_phong", [0.012, 0.012, 0.012], exponent=24.0)),
}


def materials() -> tuple[Material, ...]:
    """Return the demo's materials, in the order of the meshes' material indices."""
    textures = {"Tray": {"diffuse": wood()}}
    return tuple(Material(name, terms, textures.get(name, {})) for name, terms in TERMS.items())
