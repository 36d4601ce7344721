"""Values of the exported surface as its format defines them, at pairs of directions for fits and their errors.

    f = A (D/π + G F) + sheen + coat,   G = D_GGX V,   F = f0 (1 − k) + f90 k,   k = (1 − cos θd)⁵

with the anisotropic GGX of KHR_materials_anisotropy and the attenuation A of `relume.scene_io.surfaces.to_terms`. The
pairs are dense in half vectors near the normal: wi mirrors wo about h, dωi = 4 (wo·h) dωh. Errors weight f² by
cos² θi cos θo.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.math.polar import polar
from relume.scene_io.surfaces.to_terms import CoatLayer, PbrSurface, make_terms

F64 = NDArray[np.float64]

_NUM_VIEWS, _NUM_TURNS, _NUM_TILTS, _NUM_AZIMUTHS = 8, 3, 40, 12
_DENSITY = 4  # θh = π/2 u⁴ resolves highlights of the smallest width
_MIN_COSINE = 1e-3
_MIN_WIDTH = 1e-4  # of the term ggx


class DirectionPairs(NamedTuple):
    """Pairs of directions and the square roots of their weights.

    Attributes:
        wi, wo: local frame, unit, z = normal. (n, 3)
        weight: cos θi √(cos θo dωi dωo). (n,)
    """

    wi: F64
    wo: F64
    weight: F64

    def relative_error(self, fitted: Shaped[F64, "n 3"], original: Shaped[F64, "n 3"]) -> float:
        """Relative RMS error of weighted values; 0 if both are black."""
        difference, norm = (np.linalg.norm(self.weight[:, None] * f) for f in (fitted - original, original))
        return float(difference / norm) if norm > 0 else float(difference > 0)


@lru_cache(maxsize=2)
def direction_pairs(*, is_isotropic: bool) -> DirectionPairs:
    """Return pairs over both hemispheres; for isotropic surfaces, those with one azimuth of wo and one side of it."""
    num_turns, sides = (1, 1) if is_isotropic else (_NUM_TURNS, 2)
    theta_o = (np.arange(_NUM_VIEWS) + 0.5) / _NUM_VIEWS * (np.pi / 2)
    phi_o = np.arange(num_turns) / max(num_turns - 1, 1) * (np.pi / 2)
    u = (np.arange(_NUM_TILTS) + 0.5) / _NUM_TILTS
    phi_h = (np.arange(sides * _NUM_AZIMUTHS) + 0.5) / _NUM_AZIMUTHS * np.pi
    to, po, tilt, ph = (g.ravel() for g in np.meshgrid(theta_o, phi_o, u, phi_h, indexing="ij"))
    theta_h, step = np.pi / 2 * tilt**_DENSITY, tilt ** (_DENSITY - 1)
    wo, half = polar(to, po), polar(theta_h, ph)
    cos_d = np.einsum("nc,nc->n", wo, half)
    wi = 2 * cos_d[:, None] * half - wo
    above = (cos_d > 0) & (wi[:, 2] > _MIN_COSINE)
    solid_angles = np.sin(theta_h) * step * cos_d * np.sin(to)  # up to a common factor
    weight = np.sqrt(solid_angles[above] * wo[above, 2]) * wi[above, 2]
    return DirectionPairs(wi[above], wo[above], weight)


def term_values(terms: Sequence[Mapping[str, Any]], pairs: DirectionPairs) -> Shaped[F64, "n 3"]:
    """Sum of terms at pairs of directions, without textures."""
    black = np.zeros((len(pairs.wi), 3))
    return np.asarray(sum((eval_brdf(term, pairs.wi, pairs.wo) for term in terms), black))


def surface_values(surface: PbrSurface, coat: CoatLayer, turn: float, pairs: DirectionPairs) -> Shaped[F64, "n 3"]:
    """Values of a surface at pairs of directions, without textures.

    Args:
        surface: base layer. coat: the layers above, and anisotropy.
        turn: of the wider side of the highlight, 0 or π/2 from the tangent.
    """
    below, above = layer_values(coat, pairs)
    diffuse, at_normal, at_grazing = lobes(*microfacet_widths(surface.roughness, coat.anisotropy, turn), pairs)
    highlight = at_normal[:, None] * surface.f0 + at_grazing[:, None] * surface.f90
    albedo = surface.diffuse * (1 - surface.specular_reflectance)
    return below[:, None] * (diffuse[:, None] * albedo + highlight) + above


def microfacet_widths(roughness: float, anisotropy: float, turn: float) -> tuple[float, float]:
    """Widths α along and across the tangent, as in KHR_materials_anisotropy.

    Args:
        roughness: perceptual. anisotropy: strength. turn: 0 or π/2, of the wider side from the tangent.
    """
    narrow = max(roughness**2, _MIN_WIDTH)
    wide = narrow + (1 - narrow) * anisotropy**2
    return (narrow, wide) if turn else (wide, narrow)


def layer_values(coat: CoatLayer, pairs: DirectionPairs) -> tuple[Shaped[F64, " n"], Shaped[F64, "n 3"]]:
    """Attenuation of the layers below sheen and coat, and the sum of both."""
    white = PbrSurface(np.ones(3), np.zeros(3), 0.0, 1.0)
    base, _, *layers = make_terms(white, coat)
    return np.pi * term_values([base], pairs)[:, 0], term_values(layers, pairs)


def lobes(along: float, across: float, pairs: DirectionPairs) -> tuple[F64, F64, F64]:
    """Values of unit albedo, of f0 = 1 with f90 = 0, and of f0 = 0 with f90 = 1. (n,) each

    Args:
        along, across: widths α of the microfacets. pairs: of directions.
    """
    wi, wo = pairs.wi, pairs.wo
    half = wi + wo
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    rise = np.clip(1 - np.einsum("nc,nc->n", half, wi), 0, 1) ** 5
    slope = np.square(half / [along, across, 1.0]).sum(axis=1)
    ndf = 1 / (np.pi * along * across * np.square(slope))
    view_and_light = (v[:, 2] + np.linalg.norm(v * [along, across, 1.0], axis=1) for v in (wi, wo))
    lobe = ndf / np.prod([*view_and_light], axis=0)
    return np.full(len(wi), 1 / np.pi), lobe * (1 - rise), lobe * rise
