"""Lobes: highlights as light of a mirror that is blurred, or of two (after Sun 2007).

    L(ωo) = a(θo) · L̄(ωm, √(1 − R)),   a = ∫ ρ cos θi dωi,   R ωm = ∫ ωi ρ cos θi dωi / a

L̄ is the sky about a direction, blurred by a width; it is found for each pixel, where Σ_k p_k t_k is found for points.
Points find more: seen from aslant a highlight is longer in the plane of the eye and the normal than across it, and
leans. Two round lobes of its lesser width σ, whose mean, variance and third moment in that plane are the highlight's,
stand for it there (docs/adr/0063-highlights.md),

    L_2(ωo) = a(θo) · Σ_n s_n L̄(ω_n, σ),   s_1 + s_2 = 1 .

What is narrower than the in-basis can tell sends of the sky L_2 alone. L is what changes fastest from point to point,
and what is sent less L is interpolated: B(pixel) = L(pixel) + Σ_points w (B − L)
(docs/adr/0048-highlights-between-points.md). All stand in tables over θo, as out-factors do; of terms that depend on φo
as well, the mean over it, and one lobe.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import compress
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import TEXTURES, group_of
from relume.brdf.evaluate import eval_brdf
from relume.brdf.quadrature import Quadrature
from relume.brdf.symmetry import is_mirrored
from relume.moving.basis.out_factors import NUM_ROWS, OutFactors, cosines, of_white, text_of_white

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NARROW = 0.1  # what the in-basis misses of a term that it cannot tell, see `OutFactors.missed`
_NARROW_UNEVEN = 0.2  # the same of terms that are not isotropic, which one round lobe tells less of
_DIRECTED = 3, 0.15  # a degree, and what its functions miss of a term that has a highlight
NUM_GROUPS = 1 + len(TEXTURES)
_RINGS, _SPOKES = 64, 24  # of the quadrature about the mirror direction
_INNERMOST = 3e-4  # radians
_EYES = 8  # φo over which a term that is not isotropic is averaged
_MOST_KNOWN = 256
_LEAST_MISSED = 1e-3
_POWERS = (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)
_LEAST_WIDE = np.radians(3)
_MOST_APART = 1.8  # of 2 (1 − R), all of which two lobes without a width would have


class Lobes(NamedTuple):
    """The lobes of all materials, one each.

    Attributes:
        albedo: a, by groups of terms as in `relume.moving.evaluate`. (lobes, `NUM_ROWS`, groups, 3) float32
        cosine: cos θ of ω_1 and ω_2, on the side that the mirror direction is. (lobes, `NUM_ROWS`, 2) float32
        first: s_1. (lobes, `NUM_ROWS`) float32
        sigma: of both, radians. (lobes, `NUM_ROWS`) float32
        mean: cos θm. (lobes, `NUM_ROWS`) float32. wide: √(1 − R), σ of one lobe for both. (lobes, `NUM_ROWS`) float32
        most: what the in-basis says of the sky is believed up to so many times of what the lobe says, and down to that
            part of it; 1: it is not believed, since it cannot tell the terms. (lobes,) float32
        of: lobe of each material, −1 for none. (materials,) int32
    """

    albedo: F32
    cosine: F32
    first: F32
    sigma: F32
    mean: F32
    wide: F32
    most: F32
    of: NDArray[np.int32]

    @classmethod
    def joined(cls, parts: Sequence[Lobes]) -> Self:
        """Those of some materials, then of others."""
        first = np.cumsum([0, *(len(part.albedo) for part in parts)])
        of = [part.of + np.where(part.of >= 0, row, 0) for part, row in zip(parts, first, strict=False)]
        joined = cls(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
        return joined._replace(of=np.concatenate(of).astype(np.int32))


def is_narrow(known: OutFactors) -> bool:
    """Whether the in-basis cannot tell a term. known: its factors"""
    return known.missed > _bound_of(known)


def _bound_of(known: OutFactors) -> float:
    return NARROW if known.is_isotropic else _NARROW_UNEVEN


def _has_highlight(known: OutFactors) -> bool:
    degree, bound = _DIRECTED
    return known.missed_by_degree[degree] > bound


def are_lobes(known: Sequence[OutFactors]) -> list[bool]:
    """Tell which terms of a material its lobe stands for: narrow ones; if there are none, those with a highlight.

    Args:
        known: the factors of each.
    """
    narrow = [is_narrow(one) for one in known]
    return narrow if any(narrow) else [_has_highlight(one) for one in known]


def _most_of(known: Sequence[OutFactors]) -> float:
    """What the in-basis is believed: any multiple where it misses nothing, none where it misses `NARROW`."""
    return max(1.0, min(_bound_of(one) / max(one.missed, _LEAST_MISSED) for one in known) ** 2)


def lobes_of(materials: Sequence[Sequence[Mapping[str, Any]]]) -> Lobes:
    """Sum the narrow terms of each material to one lobe; where it has none, those with a highlight.

    Args:
        materials: the terms of each, of a complete look.
    """
    of = np.full(len(materials), -1, np.int32)
    albedo: list[F64] = []
    shape: list[F64] = []
    most: list[float] = []
    for index, terms in enumerate(materials):
        known = [of_white(term) for term in terms]
        is_seen = are_lobes(known)
        if not any(is_seen):
            continue
        of[index] = len(albedo)
        most.append(_most_of([*compress(known, is_seen)]))
        by_group, about = np.zeros((NUM_ROWS, NUM_GROUPS, 3)), np.zeros((NUM_ROWS, 6))
        for term in compress(terms, is_seen):
            found = _lobe_of(text_of_white(term))
            sent = found[:, :3] * np.asarray(term["color"], np.float64)
            by_group[:, group_of(term)] += sent
            about += sent.mean(axis=1, keepdims=True) * found[:, 3:]
        total = by_group.sum(axis=1).mean(axis=1)[:, None]
        albedo.append(by_group)
        shape.append(np.where(total > 0, about / np.maximum(total, 1e-30), 1))
    shapes = np.reshape(np.array(shape, np.float32), (len(shape), NUM_ROWS, 6))
    first, sigma, mean, wide = (np.ascontiguousarray(shapes[..., k]) for k in range(2, 6))
    return Lobes(
        np.reshape(np.array(albedo, np.float32), (len(albedo), NUM_ROWS, NUM_GROUPS, 3)),
        np.ascontiguousarray(shapes[..., :2]), first, sigma, mean, wide, np.array(most, np.float32), of,
    )  # fmt: skip


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
        ωi (rows, n, 3); ωo (rows, 1, 3); weights of cos θi dωi times x^a z^b, `_POWERS`, with x what ωi goes away from
        the eye along the surface, and z = cos θi (rows, n, powers).
    """
    away, area = _about_mirror(num_spokes)
    cosine, aside = cosines()[:, None], np.array([np.cos(phi), np.sin(phi), 0.0])
    sine = np.sqrt(1 - cosine**2)
    wo = sine * aside + cosine * [0, 0, 1]
    across = np.broadcast_to([-np.sin(phi), np.cos(phi), 0.0], wo.shape)
    wi = away @ np.stack([cosine * aside + sine * [0, 0, 1], across, cosine * [0, 0, 1] - sine * aside], axis=1)
    x, z = -(wi @ aside), wi[..., 2]
    weight = np.maximum(z, 0) * area
    return wi, wo[:, None], np.stack([weight * x**a * z**b for a, b in _POWERS], axis=-1)


def _moments_of(document: Mapping[str, Any]) -> F64:
    """∫ ρ x^a z^b cos θi dωi over `_POWERS`, the mean over φo. (channels, rows, powers)"""
    if of_white(document).is_isotropic:
        quadrature, moments = _even_quadrature()
        return np.asarray((quadrature.values(document)[..., None, :] @ moments)[..., 0, :])
    eyes, times = np.arange(_EYES) * (2 * np.pi / _EYES), np.ones(_EYES)  # how many eyes each stands for
    if is_mirrored(document):
        eyes, times = eyes[: _EYES // 4 + 1], np.array([2.0, *[4.0] * (_EYES // 4 - 1), 2.0])
    total = np.zeros((3, NUM_ROWS, len(_POWERS)))
    for phi, share in zip(eyes, times / times.sum(), strict=True):
        wi, wo, moments = _about_lobe(phi, _SPOKES)
        total += share * np.einsum("rnc,rnk->crk", eval_brdf(document, wi, wo), moments, optimize=True)
    return total


@lru_cache(maxsize=_MOST_KNOWN)
def _lobe_of(term_text: str) -> F64:
    """a of each channel, then as in `_shape_of`, in each row. (`NUM_ROWS`, 9)"""
    document = json.loads(term_text)
    moments = _moments_of(document)
    sent = np.broadcast_to(moments[..., 0], (3, NUM_ROWS)).T
    shape = _shape_of(moments.mean(axis=0), is_split=of_white(document).is_isotropic)
    return np.column_stack([sent, shape])


def _shape_of(moments: F64, *, is_split: bool) -> F64:
    """Fit one lobe or two to moments of `_POWERS`.

    With t the angle of ωm from the normal, u = x cos t − z sin t is what directions lie off it in the plane of the eye.
    A lobe of κ is R / κ wide across, E[y²]; what E[u²] is more than that, two lobes apart make up, at the two points
    that have the same second and third moment: those of a Gaussian quadrature of what a round blur leaves.

    Args:
        moments: (rows, powers). is_split: two lobes, where they fit better than one.
    Returns:
        cos θ of both, s_1, σ; cos θm and √(1 − R) of one. (rows, 6)
    """
    mean = moments[:, 1:] / np.maximum(moments[:, :1], 1e-30)
    x, z, xx, xz, zz, xxx, xxz, xzz, zzz = mean.T
    length = np.hypot(x, z)
    sine, cosine = (part / np.maximum(length, 1e-30) for part in (x, z))
    angle, width = np.arctan2(np.abs(sine), cosine), np.maximum(1 - length, 1e-8)
    along = cosine**2 * xx - 2 * sine * cosine * xz + sine**2 * zz
    third = cosine**3 * xxx - 3 * cosine**2 * sine * xxz + 3 * cosine * sine**2 * xzz - sine**3 * zzz
    apart = np.clip((along - (1 - xx - zz)) / np.maximum(length, 1e-30), 0, _MOST_APART * width)
    apart *= np.clip(np.sqrt(width) / _LEAST_WIDE - 1, 0, 1) * is_split  # points see nothing of what is narrower
    half = np.sqrt(np.maximum(apart, 1e-12))
    lean = np.clip(third / np.maximum(length, 1e-30) / (2 * half**2), -half, half)
    reach = np.sqrt(lean**2 + half**2)
    off = np.stack([lean - reach, lean + reach]) * (apart > 0)
    cosines_of = np.cos(np.clip(angle + np.arcsin(np.clip(off, -1, 1)), 0, np.pi / 2))
    sigma = np.sqrt(np.maximum(width - apart / 2, 1e-8))
    return np.column_stack([*cosines_of, (reach + lean) / (2 * reach), sigma, cosine, np.sqrt(width)])
