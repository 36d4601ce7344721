"""Importance sampling of a term's lobe: rays are drawn from the very curve that the term shows.

The curve of a round lobe is a function of the half angle θh, or of the angle θr to the mirror direction or the axis of
a Lafortune lobe. Its angles are distributed as

    p(γ) ∝ f(γ) sin γ cos γ  for θh,   p(γ) ∝ f(γ) sin γ  for θr,

the azimuth is uniform. An anisotropic lobe is the product of two curves, of the half vector's angles γ₀ along and γ₁
across the tangent. They are drawn independently, on both sides of the normal alike:

    p(γ₀, γ₁) ∝ f₀(γ₀) f₁(γ₁) .

Kernels evaluate curves in bands. The weight of a ray therefore is by the mean density of its band, and the exact curve
only decides where in the band it goes: lobes narrower than a band keep shape and energy.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from relume.brdf.curves import curve_values
from relume.brdf.frozen_term import FrozenTerm
from relume.brdf.registry import TERMS
from relume.brdf.roughness_levels import NO_LEVELS, RoughnessLevels
from relume.brdf.term import Angle, Curve
from relume.math.angle_bands import MAX_ANGLE, band_edges

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_MEDIAN = np.radians(3.0)
"""Gather rays and light triangles resolve wider lobes with less error (docs/indirect-light.md#measured)."""

_ANISOTROPIC = (Angle.TILT_X, Angle.TILT_Y, Angle.ALPHA, Angle.BETA)
_LOBE_ANGLES = (Angle.THETA_H, Angle.THETA_R, Angle.LOBE, *_ANISOTROPIC)
_NUM_QUANTILES = 4096
_SMALLEST_ANGLE = 1e-6


class LobeSampling(NamedTuple):
    """Distribution of the rays of a term, per roughness level.

    Attributes:
        angles: `THETA_H` or `THETA_R`; or two, for an anisotropic lobe: `TILT_X` and `TILT_Y`, or `ALPHA` and `BETA`.
        axes: factors of wo by which it mirrors to the axis of a θr lobe; ones for all others.
        quantile: |γ| at equal steps of the cumulative distribution, radians; the angles of each level in turn.
        band_density: mean density of each band of the curve: of θh per steradian of half vectors, of θr per steradian
            of wi, of each of two angles per radian.
        median: |γ| below which half of the rays lie, or would if both of two angles had this curve, radians.
    """

    angles: tuple[Angle, ...]
    axes: tuple[float, float, float]
    quantile: Shaped[F32, "rows quantiles"]
    band_density: Shaped[F32, "rows J"]
    median: Shaped[F64, " rows"]

    @property
    def identity(self) -> tuple[Hashable, ...]:
        """Equal for equal distributions, for keys and digests."""
        return self.angles, self.axes, self.quantile.tobytes()

    @property
    def is_half_angle(self) -> bool:
        """True if rays are drawn by their half vectors."""
        return self.angles != (Angle.THETA_R,)

    @property
    def is_round(self) -> bool:
        """True if the lobe is equal at all azimuths about the normal or the mirror direction."""
        return len(self.angles) == 1 and self.axes == (1.0, 1.0, 1.0)

    @property
    def is_narrow(self) -> Shaped[NDArray[np.bool_], " L"]:
        """True for levels at which rays are traced along the lobe: narrow along one angle at least."""
        return np.asarray(self.median.reshape(-1, len(self.angles)).min(axis=1) <= MAX_MEDIAN)


def lobe_curves(document: Mapping[str, Any]) -> tuple[Curve, ...]:
    """Return the one or two curves that shape the highlight of a term document; none for diffuse terms."""
    term = TERMS[document["model"]]
    if not any(curve.angle in _LOBE_ANGLES for curve in term.curves):
        return ()
    return tuple(curve for curve in term.normalized(document).curves if curve.angle in _LOBE_ANGLES)


def sample_lobe(document: Mapping[str, Any], levels: RoughnessLevels) -> LobeSampling | None:
    """Return the distribution of rays for a term document; None if its lobe is wide at all levels, or no lobe.

    Args:
        document: a term of a complete look. levels: roughness levels of the samples.
    """
    curves = lobe_curves(document)
    if not curves or not any(curves[0].axes):
        return None
    rows = []
    for level in levels.documents(document) or [dict(document)]:
        for curve in curves:
            row = _sample_curve(level, curve)
            if row is None:
                return None
            rows.append(row)
    quantiles, densities = zip(*rows, strict=True)
    is_direct = curves[0].angle in (Angle.THETA_R, Angle.LOBE)
    angles = (Angle.THETA_R,) if is_direct else tuple(curve.angle for curve in curves)
    x, y, z = curves[0].axes if curves[0].angle is Angle.LOBE else (-1.0, -1.0, 1.0)
    half = round(_NUM_QUANTILES * 0.5 ** (1 / len(angles)))
    median = np.array([quantile[half] for quantile in quantiles])
    arrays = np.array(quantiles, np.float32), np.array(densities, np.float32)
    lobe = LobeSampling(angles, (-x, -y, z), *arrays, median)
    return lobe if lobe.is_narrow.any() else None


def lobe_of(document: Mapping[str, Any]) -> LobeSampling | None:
    """Return `sample_lobe` of a term without a roughness map, cached. Its color and its texture do not matter."""
    return _lobe_of(FrozenTerm.from_document(document, color=(1.0, 1.0, 1.0), texture=None))


@lru_cache(maxsize=64)
def _lobe_of(term: FrozenTerm) -> LobeSampling | None:
    return sample_lobe(term.document, NO_LEVELS)


def _sample_curve(document: Mapping[str, Any], curve: Curve) -> tuple[F64, F64] | None:
    """Return quantiles and mean densities of bands of one angle, see `LobeSampling`; None if the curve is zero."""
    edges = band_edges(curve.num_bands)
    grid = np.unique(np.concatenate([[0.0], np.geomspace(_SMALLEST_ANGLE, MAX_ANGLE, _NUM_QUANTILES), edges]))
    measure, extent = _measures(curve.angle, grid, edges)
    cumulative = _mean_cumulative(curve_values(document, curve, grid) * measure, grid)
    if cumulative is None:
        return None
    is_rising = np.append(True, np.diff(cumulative) > 0)
    fraction = np.linspace(0, 1, _NUM_QUANTILES + 1)
    quantile = np.interp(fraction, cumulative[is_rising], grid[is_rising])
    # of the tabulated distribution, from which rays are drawn
    share = np.diff(np.interp(edges, quantile, fraction, left=0.0, right=1.0))
    return quantile, share / extent


def _measures(angle: Angle, grid: F64, edges: F64) -> tuple[F64, F64]:
    """Return the density of angles at grid points, for a constant curve; and the extent of each band, both signs."""
    if angle in _ANISOTROPIC:
        return np.ones_like(grid), 2 * np.diff(edges)
    measure = np.sin(grid) * (np.cos(grid) if angle is Angle.THETA_H else 1.0)
    return measure, 2 * np.pi * -np.diff(np.cos(edges))


def _mean_cumulative(lobes: Shaped[F64, "3 n"], grid: Shaped[F64, " n"]) -> Shaped[F64, " n"] | None:
    """Return the mean of the normalized cumulative distributions of channels; None if all are zero."""
    cumulative = cumulative_trapezoid(lobes, grid, axis=1, initial=0)
    total = cumulative[:, -1]
    if not np.all(np.isfinite(total)) or not np.any(total > 0):
        return None
    return np.asarray((cumulative[total > 0] / total[total > 0, None]).mean(axis=0))
