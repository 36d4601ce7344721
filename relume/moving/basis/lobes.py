"""Lobes: highlights as light of a blurred mirror (after Sun 2007).

    L(ωo) = a(θo) · L̄(ωm, σ)
    a = ∫ ρ cos θi dωi,   R ωm = ∫ ωi ρ cos θi dωi / ∫ ρ cos θi dωi,   σ² ≈ 1 − R

L̄ is the light about the lobe's mean direction ωm, blurred by σ; it is found for each pixel, where Σ_k p_k t_k is found
for points. What is narrower than the in-basis can tell is sent as L alone. Of wider highlights, L is what changes
fastest from point to point, and B − L is what is interpolated: B(pixel) = L(pixel) + Σ_points w (B − L)
(docs/adr/0048-highlights-between-points.md). All stand in tables over θo, as out-factors do; of terms that depend on
φo as well, the mean over it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from relume.brdf.albedo import TEXTURES
from relume.brdf.evaluate import eval_brdf
from relume.brdf.quadrature import Quadrature
from relume.brdf.symmetry import is_mirrored
from relume.moving.basis.out_factors import NUM_ROWS, cosines, of_white

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NARROW = 0.2  # what the in-basis misses of a term that it cannot tell, see `OutFactors.missed`
_DIRECTED = 3, 0.15  # a degree, and what its functions miss of a term that has a highlight
NUM_GROUPS = 1 + len(TEXTURES)
_RINGS, _SPOKES = 64, 24  # of the quadrature about the mirror direction
_INNERMOST = 3e-4  # radians
_EYES = 8  # φo over which a term that is not isotropic is averaged
_MOST_KNOWN = 256


class Lobes(NamedTuple):
    """The lobes of all materials, one each.

    Attributes:
        albedo: a, by groups of terms as in `relume.moving.evaluate`. (lobes, `NUM_ROWS`, groups, 3) float32
        mean: cos θm, on the side that the mirror direction is. (lobes, `NUM_ROWS`) float32
        sigma: radians. (lobes, `NUM_ROWS`) float32
        is_told: the in-basis tells what they send, too; they only say how it differs from pixel to pixel. (lobes,) bool
        of: lobe of each material, −1 for none. (materials,) int32
    """

    albedo: F32
    mean: F32
    sigma: F32
    is_told: NDArray[np.bool_]
    of: NDArray[np.int32]

    @classmethod
    def joined(cls, parts: Sequence[Lobes]) -> Self:
        """Those of some materials, then of others."""
        first = np.cumsum([0, *(len(part.albedo) for part in parts)])
        of = [part.of + np.where(part.of >= 0, row, 0) for part, row in zip(parts, first, strict=False)]
        joined = cls(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
        return joined._replace(of=np.concatenate(of).astype(np.int32))


def is_narrow(term_document: Mapping[str, Any]) -> bool:
    """Whether the in-basis cannot tell a term."""
    return of_white(term_document).missed > NARROW


def _has_highlight(term_document: Mapping[str, Any]) -> bool:
    degree, bound = _DIRECTED
    return of_white(term_document).missed_by_degree[degree] > bound


def lobes_of(materials: Sequence[Sequence[Mapping[str, Any]]]) -> Lobes:
    """Sum the narrow terms of each material to one lobe; where it has none, those with a highlight.

    Args:
        materials: the terms of each, of a complete look.
    """
    of = np.full(len(materials), -1, np.int32)
    albedo: list[F64] = []
    mean: list[F64] = []
    sigma: list[F64] = []
    told: list[bool] = []
    for index, terms in enumerate(materials):
        narrow = [term for term in terms if is_narrow(term)]
        seen = narrow or [term for term in terms if _has_highlight(term)]
        if not seen:
            continue
        of[index] = len(albedo)
        told.append(not narrow)
        by_group, about, width = np.zeros((NUM_ROWS, NUM_GROUPS, 3)), np.zeros(NUM_ROWS), np.zeros(NUM_ROWS)
        for term in seen:
            found = _lobe_of(json.dumps({**term, "color": [1.0, 1.0, 1.0], "texture": None}, sort_keys=True))
            sent = found[:, :3] * np.asarray(term["color"], np.float64)
            by_group[:, 0 if term.get("texture") is None else 1 + TEXTURES.index(term["texture"])] += sent
            weight = sent.mean(axis=1)
            about += weight * found[:, 3]
            width += weight * found[:, 4]
        total = np.maximum(by_group.sum(axis=1).mean(axis=1), 1e-30)
        albedo.append(by_group)
        mean.append(np.where(about > 0, about / total, 1))
        sigma.append(np.where(width > 0, width / total, 1))
    shape = (len(albedo), NUM_ROWS)
    return Lobes(
        np.reshape(np.array(albedo, np.float32), (*shape, NUM_GROUPS, 3)),
        np.reshape(np.array(mean, np.float32), shape),
        np.reshape(np.array(sigma, np.float32), shape),
        np.array(told, np.bool_),
        of,
    )


@lru_cache(maxsize=2)
def _about_mirror(num_spokes: int) -> tuple[F64, F64]:
    """Spread directions about a pole, over the half where y > 0 for what is the same on the other.

    Returns:
        Unit directions (n, 3) and solid angles (n,).
    """
    ring = np.geomspace(_INNERMOST, np.pi, _RINGS + 1)
    middle, spoke = np.sqrt(ring[1:] * ring[:-1]), (np.arange(num_spokes) + 0.5) * (2 * np.pi / _SPOKES)
    around = np.stack([np.cos(spoke), np.sin(spoke), np.zeros(num_spokes)], axis=-1)
    away = np.sin(middle)[:, None, None] * around + np.cos(middle)[:, None, None] * [0, 0, 1]
    area = np.repeat((np.cos(ring[:-1]) - np.cos(ring[1:])) / num_spokes * 2 * np.pi, num_spokes)
    return away.reshape(-1, 3), area


@lru_cache(maxsize=1)
def _even_quadrature() -> tuple[Quadrature, F64]:
    """Where isotropic terms are evaluated, and the moments about it."""
    wi, wo, moments = _about_lobe(0.0, _SPOKES // 2)
    return Quadrature(wi, wo), moments


def _about_lobe(phi: float, num_spokes: int) -> tuple[F64, F64, F64]:
    """Spread directions about the mirror directions of eyes in all rows.

    Args:
        phi: φo of the eyes. num_spokes: of the directions about each.
    Returns:
        ωi (rows, n, 3); ωo (rows, 1, 3); weights of cos θi dωi, alone, times what ωi goes away from the eye along the
        surface, and times cos θi (rows, n, 3).
    """
    away, area = _about_mirror(num_spokes)
    cosine, aside = cosines()[:, None], np.array([np.cos(phi), np.sin(phi), 0.0])
    sine = np.sqrt(1 - cosine**2)
    wo = sine * aside + cosine * [0, 0, 1]
    across = np.broadcast_to([-np.sin(phi), np.cos(phi), 0.0], wo.shape)
    wi = away @ np.stack([cosine * aside + sine * [0, 0, 1], across, cosine * [0, 0, 1] - sine * aside], axis=1)
    weight = np.maximum(wi[..., 2], 0) * area
    return wi, wo[:, None], weight[..., None] * np.stack([np.ones_like(weight), -(wi @ aside), wi[..., 2]], axis=-1)


def _moments_of(document: Mapping[str, Any]) -> F64:
    """∫ ρ cos θi dωi, and the same times the two parts of ωi, the mean over φo. (channels, rows, 3)"""
    if of_white(document).is_isotropic:
        quadrature, moments = _even_quadrature()
        return np.asarray((quadrature.values(document)[..., None, :] @ moments)[..., 0, :])
    eyes, times = np.arange(_EYES) * (2 * np.pi / _EYES), np.ones(_EYES)  # how many eyes each stands for
    if is_mirrored(document):
        eyes, times = eyes[: _EYES // 4 + 1], np.array([2.0, *[4.0] * (_EYES // 4 - 1), 2.0])
    total = np.zeros((3, NUM_ROWS, 3))
    for phi, share in zip(eyes, times / times.sum(), strict=True):
        wi, wo, moments = _about_lobe(phi, _SPOKES)
        total += share * np.einsum("rnc,rnk->crk", eval_brdf(document, wi, wo), moments, optimize=True)
    return total


@lru_cache(maxsize=_MOST_KNOWN)
def _lobe_of(term_text: str) -> F64:
    """a of each channel, cos θm, and σ, in each row. (`NUM_ROWS`, 5)"""
    moments = _moments_of(json.loads(term_text))
    sent, mean = np.broadcast_to(moments[..., 0], (3, NUM_ROWS)).T, moments[..., 1:].mean(axis=0)
    reach = np.linalg.norm(mean, axis=1)
    length = reach / np.maximum(sent.mean(axis=1), 1e-30)
    tilt = mean[:, 1] / np.maximum(reach, 1e-30)
    return np.column_stack([sent, tilt, np.sqrt(np.maximum(1 - length, 1e-8))])
