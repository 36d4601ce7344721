"""glTF's sheen as a term whose curves are drawn.

KHR_materials_sheen: f = D(θh) V, D = (2 + 1/α) sin^(1/α) θh / 2π, V = 1 / (4 (n·wi)(n·wo) (1 + Λ(θi) + Λ(θo))), Estevez
and Kulla 2017. `ggx` has the quotient 1 / (4 (n·wi)(n·wo)) and a curve of θh; what is left, 1 / (1 + Λ + Λ), becomes a
product g(θi) k(θo), the nearest one in g, and with k such that all light together is reflected towards each θo as by
the formula.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.basis.bands import band_averages

F64 = NDArray[np.float64]
NUM_ANGLES = 46  # of drawn curves, evenly from 0 to 90 degrees
MIN_ALPHA = 0.07**2  # of the specification's sample implementation; a smaller one is a spike at the horizon
_FINE = 90  # angles of integrals


def sheen_alpha(roughness: float) -> float:
    """Width α of the fibres' distribution."""
    return max(roughness**2, MIN_ALPHA)


def fibres(theta_h: F64, alpha: float) -> F64:
    """D, in 1/sr. (...)"""
    return np.asarray((2 + 1 / alpha) * np.sin(theta_h) ** (1 / alpha) / (2 * np.pi))


def hidden(cosine: F64, alpha: float) -> F64:
    """Λ of fibres that are seen at these cosines; a fit of the paper's, eq. 3. (...)"""

    def fit(x: F64) -> F64:
        share = (1 - alpha) ** 2
        smooth, rough = (25.3245, 3.32435, 0.16801, -1.27393, -4.85967), (21.5473, 3.82987, 0.19823, -1.97760, -4.32054)
        a, b, c, d, e = (share * one + (1 - share) * other for one, other in zip(smooth, rough, strict=True))
        return np.asarray(a / (1 + b * x**c) + d * x + e)

    steep = np.exp(2 * fit(np.array(0.5)) - fit(np.maximum(1 - cosine, 0)))
    return np.where(cosine < 0.5, np.exp(fit(cosine)), steep)


class _Factors(NamedTuple):
    """At the middles of `_FINE` bands of an angle: g, k, and the albedo towards that angle. (_FINE,) each"""

    light: F64
    view: F64
    albedo: F64


@lru_cache(maxsize=64)
def _factors(alpha: float) -> _Factors:
    """g is the leading vector of 1 / (1 + Λ + Λ), weighed by solid angle over the cosine, by which V divides."""
    theta = _middles()
    of_one = hidden(np.cos(theta), alpha)
    open_share = 1 / (1 + of_one[:, None] + of_one)
    weight = np.sqrt(np.tan(theta))
    values, vectors = np.linalg.eigh(weight[:, None] * weight * open_share)
    light = np.abs(vectors[:, -1]) * np.sqrt(values[-1]) / weight
    arriving = _fibres_of_pairs(alpha) * np.sin(theta) * (2 * np.pi * np.pi / 2 / _FINE)  # by θo and θi
    total = (arriving * open_share).sum(axis=1)
    albedo = np.minimum(total / (4 * np.cos(theta)), 1)
    return _Factors(light, total / np.maximum((arriving * light).sum(axis=1), 1e-30), albedo)


def _fibres_of_pairs(alpha: float) -> F64:
    """D of θo and θi, its mean over the azimuth between the two. (_FINE, _FINE)"""
    cosine, sine, phi = np.cos(_middles()), np.sin(_middles()), _middles(64) * 2
    across = np.hypot(sine[:, None] * np.cos(phi) + sine[:, None, None], sine[:, None] * np.sin(phi))
    return np.asarray(fibres(np.arctan2(across, cosine[:, None] + cosine[:, None, None]), alpha).mean(axis=2))


def sheen_albedo(theta_o: F64, roughness: float) -> F64:
    """Share of the light of all directions together that a white sheen reflects towards one. (...)"""
    return np.asarray(np.interp(theta_o, _middles(), _factors(sheen_alpha(roughness)).albedo))


def sheen_term(color: Sequence[float], roughness: float) -> dict[str, Any]:
    """The term of a sheen of this colour."""
    alpha, theta = sheen_alpha(roughness), np.linspace(0, np.pi / 2, NUM_ANGLES)
    light, view = (np.interp(theta, _middles(), of) for of in _factors(alpha)[:2])
    drawn = {"theta_h": fibres(theta, alpha), "theta_i": light, "theta_d": np.ones(NUM_ANGLES)}
    curves: dict[str, Any] = {
        name: {"points": np.round(np.column_stack([np.degrees(theta), values]), 6).tolist(), "channels": "rgb"}
        for name, values in drawn.items()
    }
    seen = band_averages(lambda angles: np.interp(angles, theta, view), 64)
    curves["theta_o"] = {"bands": np.round(seen, 6).tolist(), "channels": "rgb"}
    return {"model": "ggx", "color": list(color), "texture": None, "curves": curves}


def _middles(num: int = _FINE) -> F64:
    return np.asarray((np.arange(num) + 0.5) * (np.pi / 2 / num))
