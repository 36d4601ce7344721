"""glTF's sheen as a curve over the half angle, for a term whose quotient is 1.

KHR_materials_sheen: f = D V with D = (2 + 1/α) sin^(1/α) θh / 2π (Estevez and Kulla 2017) and
V = 1 / (4 (n·wi + n·wo - (n·wi)(n·wo))). V depends on more than θh: it is replaced by its mean over all pairs of
directions with that half vector, weighted by both cosines.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
NUM_ANGLES = 46  # of θh, evenly from 0 to 90 degrees
MIN_ALPHA = 0.07**2  # of the specification's sample implementation; a smaller one is a spike at the horizon


@lru_cache(maxsize=1)
def _mean_masking() -> tuple[F64, F64]:
    """Mean V for each θh, and the weight of that θh in the mean albedo. (NUM_ANGLES,) each

    The weight is ∫ (n·wi)(n·wo) 4 cos θd dωd: dωi dωo = 4 cos θd dωd dωh.
    """
    theta_h = np.linspace(0, np.pi / 2, NUM_ANGLES)[:, None, None]
    theta_d = ((np.arange(64) + 0.5) * (np.pi / 128))[None, :, None]
    phi = ((np.arange(128) + 0.5) * (np.pi / 64))[None, None, :]
    along, across = np.cos(theta_h) * np.cos(theta_d), np.sin(theta_h) * np.sin(theta_d) * np.cos(phi)
    cos_i, cos_o = along + across, along - across
    seen = (cos_i > 0) & (cos_o > 0)
    area = np.sin(theta_d) * (np.pi / 128) * (np.pi / 64)
    weight = np.where(seen, cos_i * cos_o, 0) * 4 * np.cos(theta_d) * area
    masking = 1 / (4 * np.where(seen, cos_i + cos_o - cos_i * cos_o, 1))
    total = weight.sum((1, 2))
    mean = (weight * masking).sum((1, 2))[:-1] / total[:-1]
    return np.append(mean, mean[-1]), total  # at 90 degrees no pair is left


def sheen_curve(roughness: float) -> tuple[list[list[float]], float]:
    """Points [degrees, value] of D·V over θh, and the mean albedo of a white sheen: Σ f (n·wi)(n·wo) / π."""
    theta_h = np.linspace(0, np.pi / 2, NUM_ANGLES)
    exponent = 1 / max(roughness**2, MIN_ALPHA)
    masking, weight = _mean_masking()
    value = (2 + exponent) * np.sin(theta_h) ** exponent / (2 * np.pi) * masking
    albedo = np.trapezoid(value * weight * 2 * np.pi * np.sin(theta_h), theta_h) / np.pi
    points = np.round(np.column_stack([np.degrees(theta_h), value]), 6)
    return points.tolist(), float(albedo)
