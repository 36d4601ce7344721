"""Terms whose lobes are ray traced for each pixel: round lobes narrower than what probes store."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.albedo import directional_albedo
from relume.brdf.lobe_sampling import LobeSampling, lobe_of
from relume.brdf.texture_slots import texture_slot
from relume.live.free_camera.basis.highlight_lobes import NUM_GROUPS
from relume.live.free_camera.basis.outgoing_coefficients import NUM_ROWS, cosines

F32 = NDArray[np.float32]

_BLURS = 0.45 * 2 ** (np.arange(7) / 2)  # σ of Gaussians, by the median angle of a lobe
_NUM_FITTED, _LEAST_WIDTH = 64, 1e-6  # angles of a fit; radians
Terms = Sequence[Mapping[str, Any]]


class TracedLobe(NamedTuple):
    """The narrow terms of a material.

    Attributes:
        sampling: distribution of rays, of the first of them. core: of its inner half.
        blur: of an environment in the lobe: σ of two Gaussians, radians, ascending, and the share of the first.
        albedo: directional albedo over θo, by groups of terms as in `relume.live.free_camera.shade_probes`.
    """

    sampling: LobeSampling
    core: LobeSampling
    blur: tuple[np.float32, np.float32, np.float32]
    albedo: Shaped[F32, "rows groups 3"]


def has_traced_lobe(terms: Terms) -> bool:
    """Return whether a material has narrow terms. terms: of a complete look"""
    return any(_round_lobe(term) is not None for term in terms)


def _round_lobe(term: Mapping[str, Any]) -> LobeSampling | None:
    """Return the distribution of rays of a term; None if its lobe is wide or anisotropic."""
    sampling = lobe_of(term)
    return sampling if sampling is not None and sampling.is_round else None


def split_terms(terms: Terms) -> tuple[TracedLobe | None, Terms]:
    """Split the terms of a material into narrow ones, None for none, and the others. terms: of a complete look"""
    samplings = [_round_lobe(term) for term in terms]
    narrow = [term for term, sampling in zip(terms, samplings, strict=True) if sampling is not None]
    if not narrow:
        return None, terms
    albedo = np.zeros((NUM_ROWS, NUM_GROUPS, 3), np.float32)
    for group in {texture_slot(term) for term in narrow}:
        theta_o, values = directional_albedo([term for term in narrow if texture_slot(term) == group])
        for channel in range(3):
            albedo[:, group, channel] = np.interp(np.arccos(cosines()), theta_o, values[:, channel])
    others = [term for term, sampling in zip(terms, samplings, strict=True) if sampling is None]
    sampling = next(sampling for sampling in samplings if sampling is not None)
    return TracedLobe(sampling, _inner_half(sampling), fit_blur(sampling), albedo), others


def fit_blur(sampling: LobeSampling) -> tuple[np.float32, np.float32, np.float32]:
    """Fit two Gaussians to the cumulative distribution of a round lobe; see `TracedLobe.blur`."""
    fraction = np.linspace(0, 1, sampling.quantile.shape[1])
    angle = sampling.quantile[0].astype(np.float64) * (2 if sampling.is_half_angle else 1)
    width = max(float(np.interp(0.5, fraction, angle)), _LEAST_WIDTH)
    at = width * np.geomspace(0.1, 10, _NUM_FITTED)
    cumulative = np.interp(at, angle, fraction)
    gaussians = 1 - np.exp(-0.5 * (at / (width * _BLURS[:, None])) ** 2)
    best = np.inf, 0, 0, 1.0
    for i, j in combinations(range(len(_BLURS)), 2):
        rest, difference = cumulative - gaussians[j], gaussians[i] - gaussians[j]
        share = float(np.clip(rest @ difference / (difference @ difference), 0, 1))
        best = min(best, (float(np.square(rest - share * difference).sum()), i, j, share))
    _, i, j, share = best
    return np.float32(width * _BLURS[i]), np.float32(width * _BLURS[j]), np.float32(share)


def _inner_half(sampling: LobeSampling) -> LobeSampling:
    """Return the distribution of the half of all rays that is nearest to the peak."""
    fraction = np.linspace(0, 1, sampling.quantile.shape[1])
    quantile = [np.interp(0.5 * fraction, fraction, row) for row in sampling.quantile]
    return sampling._replace(quantile=np.array(quantile, np.float32))
