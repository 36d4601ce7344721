"""glTF's sheen: the term `sheen`, and how what lies below it is dimmed.

KHR_materials_sheen: what lies below keeps min(1 − c E(θi), 1 − c E(θo)) of its light, with the albedo E of a white
sheen and c the largest channel of its colour. Layers have curves of both angles: the minimum becomes a product g(θi)
k(θo), the nearest one in g, and with k such that of even light as much is kept towards each θo as by the formula.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.brdf.terms.sheen import MIN_ROUGHNESS

F64 = NDArray[np.float64]
Attenuation = Callable[[F64], F64]
_NUM_ANGLES, _NUM_AZIMUTHS = 90, 64  # angles and azimuths of integrals


def sheen_term(color: Sequence[float], roughness: float) -> dict[str, Any]:
    """The term of a sheen of this colour."""
    params = {"roughness": round(max(roughness, MIN_ROUGHNESS), 6)}
    return {"model": "sheen", "color": list(color), "texture": None, "params": params}


def sheen_albedo(theta_o: F64, roughness: float) -> F64:
    """Share of the light of all directions together that a white sheen reflects towards one. (...)"""
    return np.asarray(np.interp(theta_o, _bin_centers(), _albedo(max(roughness, MIN_ROUGHNESS))))


def sheen_attenuation(max_sheen: float, roughness: float, *, by_light: bool) -> tuple[Attenuation, Attenuation]:
    """Shares of light that what lies below a sheen keeps, by θi and by θo.

    Args:
        max_sheen: the largest channel of the sheen's colour. roughness: of the sheen.
        by_light: whether the first may be other than one.
    """
    theta = _bin_centers()
    attenuation = np.maximum(1 - max_sheen * sheen_albedo(theta, roughness), 0)
    pair_attenuation, cosine_weights = np.minimum(attenuation[:, None], attenuation), np.sin(theta) * np.cos(theta)
    light = np.ones(_NUM_ANGLES)
    if by_light:
        root = np.sqrt(cosine_weights)
        leading_eigenvector = np.abs(np.linalg.eigh(root[:, None] * root * pair_attenuation)[1][:, -1]) / root
        light = leading_eigenvector / leading_eigenvector.max()
    view = pair_attenuation @ cosine_weights / (light @ cosine_weights)
    return lambda angles: np.interp(angles, theta, light), lambda angles: np.interp(angles, theta, view)


@lru_cache(maxsize=64)
def _albedo(roughness: float) -> F64:
    """∫ f cos θi dωi at the middles of `_NUM_ANGLES` bands of θo. (_FINE,)"""
    theta, phi = _bin_centers()[:, None], 2 * _bin_centers(_NUM_AZIMUTHS)
    cosine, sine = np.broadcast_to(np.cos(theta), (_NUM_ANGLES, _NUM_AZIMUTHS)), np.sin(theta)
    wi = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=-1)
    wo = np.stack([sine, 0 * sine, np.cos(theta)], axis=-1)[:, None]
    value = eval_brdf(sheen_term([1, 1, 1], roughness), wi, wo)[..., 0].mean(axis=2)  # by θo and θi
    cosine_weights = (np.sin(theta) * np.cos(theta))[:, 0] * (2 * np.pi * np.pi / 2 / _NUM_ANGLES)
    return np.asarray(np.minimum(value @ cosine_weights, 1))


def _bin_centers(num: int = _NUM_ANGLES) -> F64:
    return np.asarray((np.arange(num) + 0.5) * (np.pi / 2 / num))
