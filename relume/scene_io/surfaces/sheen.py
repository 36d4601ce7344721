"""glTF's sheen: the term `sheen`, and the attenuation of the layers below.

KHR_materials_sheen scales the layers below by min(1 − c E(θi), 1 − c E(θo)), with the albedo E of a white sheen and its
largest color channel c. Terms have separate curves of both angles, so the minimum is approximated by a product g(θi)
k(θo): g is the best rank-one fit, and k conserves the reflected energy toward each θo under uniform light.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.brdf.terms.sheen import MIN_ROUGHNESS

F64 = NDArray[np.float64]
Attenuation = Callable[[F64], F64]
_NUM_ANGLES, _NUM_AZIMUTHS = 90, 64  # of numerical integrals


def sheen_term(color: Sequence[float], roughness: float) -> dict[str, Any]:
    """The sheen term with this color."""
    params = {"roughness": round(max(roughness, MIN_ROUGHNESS), 6)}
    return {"model": "sheen", "color": list(color), "texture": None, "params": params}


def sheen_albedo(theta_o: Shaped[F64, "*angles"], roughness: float) -> Shaped[F64, "*angles"]:
    """Albedo of a white sheen for outgoing angles θo."""
    return np.asarray(np.interp(theta_o, _bin_centers(), _albedo(max(roughness, MIN_ROUGHNESS))))


def sheen_attenuation(max_sheen: float, roughness: float, *, by_light: bool) -> tuple[Attenuation, Attenuation]:
    """Attenuation of the layers below a sheen, as functions of θi and of θo.

    Args:
        max_sheen: largest channel of the sheen's color. roughness: roughness of the sheen.
        by_light: False if the layer has no curve of θi, so that the first function is one.
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
    """∫ f cos θi dωi at the centers of `_NUM_ANGLES` bands of θo. (_NUM_ANGLES,)"""
    theta, phi = _bin_centers()[:, None], 2 * _bin_centers(_NUM_AZIMUTHS)
    cosine, sine = np.broadcast_to(np.cos(theta), (_NUM_ANGLES, _NUM_AZIMUTHS)), np.sin(theta)
    wi = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=-1)
    wo = np.stack([sine, 0 * sine, np.cos(theta)], axis=-1)[:, None]
    value = eval_brdf(sheen_term([1, 1, 1], roughness), wi, wo)[..., 0].mean(axis=2)  # by θo and θi
    cosine_weights = (np.sin(theta) * np.cos(theta))[:, 0] * (2 * np.pi * np.pi / 2 / _NUM_ANGLES)
    return np.asarray(np.minimum(value @ cosine_weights, 1))


def _bin_centers(num: int = _NUM_ANGLES) -> F64:
    return np.asarray((np.arange(num) + 0.5) * (np.pi / 2 / num))
