"""Importance sampling of a term's lobe: rays are drawn from the very curve that the term shows.

The curve is a function of the half angle θh, or of the angle θr to the mirror direction. Its angles are distributed as

    p(γ) ∝ f(γ) sin γ cos γ  for θh,   p(γ) ∝ f(γ) sin γ  for θr,

the azimuth is uniform. Kernels evaluate curves in bands. The weight of a ray therefore is by the mean density of its
band, and the exact curve only decides where in the band it goes: lobes narrower than a band keep shape and energy.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from relume.brdf.curves import curve_values
from relume.brdf.registry import TERMS
from relume.brdf.roughness_levels import RoughnessLevels, scaled_roughness
from relume.brdf.term import Angle, Curve
from relume.math.angle_bands import MAX_ANGLE, band_edges

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_MEDIAN = np.radians(3.0)
"""Gather rays and light triangles resolve wider lobes with less error (docs/indirect-light.md#measured)."""

_NUM_QUANTILES = 4096
_SMALLEST_ANGLE = 1e-6


class LobeSampling(NamedTuple):
    """Distribution of the rays of a term, per roughness level.

    Attributes:
        quantile: angle γ at equal steps of the cumulative distribution, radians.
        band_density: mean density of each band of the curve per steradian: of half vectors for θh, else of wi.
        is_half_angle: whether γ is θh, else θr.
        median: of γ at each level, radians.
    """

    quantile: Shaped[F32, "L quantiles"]
    band_density: Shaped[F32, "L J"]
    is_half_angle: bool
    median: Shaped[F64, " L"]

    @property
    def is_narrow(self) -> Shaped[NDArray[np.bool_], " L"]:
        """True for levels at which rays are traced along the lobe."""
        return np.asarray(self.median <= MAX_MEDIAN)


def lobe_curve(model: str) -> Curve | None:
    """Return the curve that shapes the highlight of a model; None for diffuse and anisotropic terms."""
    curves = [curve for curve in TERMS[model].curves if curve.angle in (Angle.THETA_H, Angle.THETA_R)]
    return curves[0] if len(curves) == 1 else None


def sample_lobe(document: Mapping[str, Any], levels: RoughnessLevels) -> LobeSampling | None:
    """Return the distribution of rays for a term document; None if its lobe is wide at all levels, or no lobe.

    Args:
        document: a term of a complete look. levels: roughness levels of the samples.
    """
    curve = lobe_curve(document["model"])
    if curve is None:
        return None
    is_half_angle, edges = curve.angle is Angle.THETA_H, band_edges(curve.num_bands)
    grid = np.unique(np.concatenate([[0.0], np.geomspace(_SMALLEST_ANGLE, MAX_ANGLE, _NUM_QUANTILES), edges]))
    measure = np.sin(grid) * (np.cos(grid) if is_half_angle else 1.0)
    fraction = np.linspace(0, 1, _NUM_QUANTILES + 1)
    quantiles, densities = [], []
    for level in [scaled_roughness(document, ratio) for ratio in levels.ratios] or [dict(document)]:
        cumulative = _mean_cumulative(curve_values(level, curve, grid) * measure, grid)
        if cumulative is None:
            return None
        is_rising = np.append(True, np.diff(cumulative) > 0)
        quantile = np.interp(fraction, cumulative[is_rising], grid[is_rising])
        # of the tabulated distribution, from which rays are drawn
        share = np.diff(np.interp(edges, quantile, fraction, left=0.0, right=1.0))
        quantiles.append(quantile)
        densities.append(share / (2 * np.pi * -np.diff(np.cos(edges))))
    median = np.array([quantile[_NUM_QUANTILES // 2] for quantile in quantiles])
    lobe = LobeSampling(np.array(quantiles, np.float32), np.array(densities, np.float32), is_half_angle, median)
    return lobe if lobe.is_narrow.any() else None


def _mean_cumulative(lobes: Shaped[F64, "3 n"], grid: Shaped[F64, " n"]) -> Shaped[F64, " n"] | None:
    """Return the mean of the normalized cumulative distributions of channels; None if all are zero."""
    cumulative = cumulative_trapezoid(lobes, grid, axis=1, initial=0)
    total = cumulative[:, -1]
    if not np.all(np.isfinite(total)) or not np.any(total > 0):
        return None
    return np.asarray((cumulative[total > 0] / total[total > 0, None]).mean(axis=0))
