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
from relume.brdf.terms.sheen import LEAST_ROUGHNESS

F64 = NDArray[np.float64]
Kept = Callable[[F64], F64]
_FINE, _AROUND = 90, 64  # angles and azimuths of integrals


def sheen_term(color: Sequence[float], roughness: float) -> dict[str, Any]:
    """The term of a sheen of this colour."""
    params = {"roughness": round(max(roughness, LEAST_ROUGHNESS), 6)}
    return {"model": "sheen", "color": list(color), "texture": None, "params": params}


def sheen_albedo(theta_o: F64, roughness: float) -> F64:
    """Share of the light of all directions together that a white sheen reflects towards one. (...)"""
    return np.asarray(np.interp(theta_o, _middles(), _albedo(max(roughness, LEAST_ROUGHNESS))))


def below_sheen(most: float, roughness: float, *, by_light: bool) -> tuple[Kept, Kept]:
    """Shares of light that what lies below a sheen keeps, by θi and by θo.

    Args:
        most: the largest channel of the sheen's colour. roughness: of the sheen.
        by_light: whether the first may be other than one.
    """
    theta = _middles()
    kept = np.maximum(1 - most * sheen_albedo(theta, roughness), 0)
    of_pairs, arriving = np.minimum(kept[:, None], kept), np.sin(theta) * np.cos(theta)
    light = np.ones(_FINE)
    if by_light:
        root = np.sqrt(arriving)
        leading = np.abs(np.linalg.eigh(root[:, None] * root * of_pairs)[1][:, -1]) / root
        light = leading / leading.max()
    view = of_pairs @ arriving / (light @ arriving)
    return lambda angles: np.interp(angles, theta, light), lambda angles: np.interp(angles, theta, view)


@lru_cache(maxsize=64)
def _albedo(roughness: float) -> F64:
    """∫ f cos θi dωi at the middles of `_FINE` bands of θo. (_FINE,)"""
    theta, phi = _middles()[:, None], 2 * _middles(_AROUND)
    cosine, sine = np.broadcast_to(np.cos(theta), (_FINE, _AROUND)), np.sin(theta)
    wi = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=-1)
    wo = np.stack([sine, 0 * sine, np.cos(theta)], axis=-1)[:, None]
    value = eval_brdf(sheen_term([1, 1, 1], roughness), wi, wo)[..., 0].mean(axis=2)  # by θo and θi
    arriving = (np.sin(theta) * np.cos(theta))[:, 0] * (2 * np.pi * np.pi / 2 / _FINE)
    return np.asarray(np.minimum(value @ arriving, 1))


def _middles(num: int = _FINE) -> F64:
    return np.asarray((np.arange(num) + 0.5) * (np.pi / 2 / num))
