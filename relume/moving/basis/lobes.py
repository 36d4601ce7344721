"""Lobes: highlights as light of a mirror that is blurred, or of two (after Sun 2007).

    L(ωo) = a(θo) · L̄(ωm, √(1 − R)),   a = ∫ ρ cos θi dωi,   R ωm = ∫ ωi ρ cos θi dωi / a

L̄ is the sky about a direction, blurred by a width; it is found for each pixel, where Σ_k p_k t_k is found for points.
Points find more: most highlights have a core and a wide skirt, and seen from aslant they are longer in the plane of the
eye and the normal than across it, and lean. Two round lobes stand for one there (`relume.moving.basis.two_lobes`,
docs/adr/0098-core-and-skirt.md),

    L_2(ωo) = a(θo) · Σ_n s_n L̄(ω_n, σ_n),   s_1 + s_2 = 1 ,

and for each pixel, too, where both are not alike. What the in-basis cannot tell is summed over lights, by the shape of
the terms (`relume.moving.basis.shapes`), and where these are narrower than lights it is L_2. L is what changes fastest
from point to point, and what is sent less L is interpolated: B(pixel) = L(pixel) + Σ_points w (B − L)
(docs/adr/0048-highlights-between-points.md). All stand in tables over θo, as out-factors do; of terms that depend on
φo as well, the mean over it, and one lobe.
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
from relume.moving.basis.shapes import NUM_PLACES, about_mirror, places, shapes_of
from relume.moving.basis.two_lobes import NUM_NUMBERS, fit_two

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NARROW = 0.1  # what the in-basis misses of a term that it cannot tell, see `OutFactors.missed`
_TOLD = 0.03  # the same, up to which it tells the sky in a highlight as well as lights do, in less time
_NARROW_UNEVEN = 0.2  # the same of terms that are not isotropic, which one round lobe tells less of
_DIRECTED = 3, 0.15  # a degree, and what its functions miss of a term that has a highlight
NUM_GROUPS = 1 + len(TEXTURES)
_RINGS, _SPOKES = 64, 24  # of the quadrature about the mirror direction
_INNERMOST = 3e-4  # radians
_EYES = 8  # φo over which a term that is not isotropic is averaged
_MOST_KNOWN = 256
_LEAST_MISSED = 1e-3
_NUM_SHAPE = NUM_NUMBERS + 2
_ALIKE = 1.5  # times as wide as the other is a lobe, at most, where one stands for both
_ASLANT = 0.3  # cos θo above which that counts: farther aslant all lobes are unlike


class Lobes(NamedTuple):
    """The lobes of all materials, one each.

    Attributes:
        albedo: a, by groups of terms as in `relume.moving.evaluate`. (lobes, `NUM_ROWS`, groups, 3) float32
        cosine: cos θ of ω_1 and ω_2, on the side that the mirror direction is. (lobes, `NUM_ROWS`, 2) float32
        first: s_1. (lobes, `NUM_ROWS`) float32
        sigma: of both, radians. (lobes, `NUM_ROWS`, 2) float32
        mean: cos θm. (lobes, `NUM_ROWS`) float32. wide: √(1 − R), σ of one lobe for both. (lobes, `NUM_ROWS`) float32
        most: what the in-basis says of the sky is believed up to so many times of what the lobe says, and down to that
            part of it; 1: it is not believed, since it cannot tell the terms: lights do. (lobes,) float32
        is_two: whether one lobe for both would stand for it badly. (lobes,) bool
        shape, flatness, believed: of the whole, see `relume.moving.basis.shapes`: T, α², and 1 − β, which is one where
            the in-basis is believed. (lobes, `NUM_ROWS`, widths, places), (lobes,), (lobes, `NUM_ROWS`) float32
        of: lobe of each material, −1 for none. (materials,) int32
    """

    albedo: F32
    cosine: F32
    first: F32
    sigma: F32
    mean: F32
    wide: F32
    most: F32
    is_two: NDArray[np.bool_]
    shape: F32
    flatness: F32
    believed: F32
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


def is_told(terms: Sequence[Mapping[str, Any]]) -> bool:
    """Whether the in-basis tells the sky in a highlight: it misses nothing, or little of one that has no skirt.

    Args:
        terms: that the highlight consists of, of a complete look.
    """
    return all(map(_is_told, terms))


def _is_told(term: Mapping[str, Any]) -> bool:
    known = of_white(term)
    return known.missed <= _TOLD or not (is_narrow(known) or _are_unlike(_lobe_of(text_of_white(term))[:, 6:8]))


def _are_unlike(sigma: F64) -> bool:
    """Whether one lobe would stand for both badly. sigma: of both. (rows, 2)"""
    return bool((sigma.max(axis=1) > _ALIKE * sigma.min(axis=1))[cosines() > _ASLANT].any())


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


def _most_of(terms: Sequence[Mapping[str, Any]]) -> float:
    """What the in-basis is believed: any multiple where it misses nothing, none where it does not tell the sky."""
    if not is_told(terms):
        return 1.0
    return max(1.0, min(_bound_of(one) / max(one.missed, _LEAST_MISSED) for one in map(of_white, terms)) ** 2)


def lobes_of(materials: Sequence[Sequence[Mapping[str, Any]]]) -> Lobes:
    """Sum the narrow terms of each material to one lobe; where it has none, those with a highlight.

    Args:
        materials: the terms of each, of a complete look.
    """
    of = np.full(len(materials), -1, np.int32)
    albedo: list[F64] = []
    shape: list[F64] = []
    everywhere: list[F64] = []
    most: list[float] = []
    for index, terms in enumerate(materials):
        known = [of_white(term) for term in terms]
        is_seen = are_lobes(known)
        if not any(is_seen):
            continue
        of[index] = len(albedo)
        most.append(_most_of([*compress(terms, is_seen)]))
        by_group, about = np.zeros((NUM_ROWS, NUM_GROUPS, 3)), np.zeros((NUM_ROWS, _NUM_SHAPE))
        at_places = np.zeros((NUM_ROWS, NUM_PLACES))
        is_asked = most[-1] == 1  # else the in-basis tells it
        for term in compress(terms, is_seen):
            found = _lobe_of(text_of_white(term))
            sent = found[:, :3] * np.asarray(term["color"], np.float64)
            by_group[:, group_of(term)] += sent
            about += sent.mean(axis=1, keepdims=True) * found[:, 3:]
            if is_asked:
                at_places += np.mean(term["color"]) * _at_places(text_of_white(term))
        total = by_group.sum(axis=1).mean(axis=1)[:, None]
        albedo.append(by_group)
        shape.append(np.where(total > 0, about / np.maximum(total, 1e-30), 1))
        everywhere.append(np.where(total > 0, at_places / np.maximum(total, 1e-30), 0))
    shapes = np.reshape(np.array(shape, np.float32), (len(shape), NUM_ROWS, _NUM_SHAPE))
    cosine, sigma = (np.ascontiguousarray(shapes[..., k : k + 2]) for k in (0, 3))
    first, mean, wide = (np.ascontiguousarray(shapes[..., k]) for k in (2, 5, 6))
    is_two = np.array([_are_unlike(one) for one in sigma], np.bool_)
    whole = shapes_of(everywhere, [numbers[:, :NUM_NUMBERS] for numbers in shape], np.array(most) > 1)
    return Lobes(
        np.reshape(np.array(albedo, np.float32), (len(albedo), NUM_ROWS, NUM_GROUPS, 3)),
        cosine, first, sigma, mean, wide, np.array(most, np.float32), is_two, *whole, of,
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


class _Even(NamedTuple):
    """Where isotropic terms are evaluated.

    Attributes:
        quadrature: for φo = 0. moments: about it, see `_about_lobe`.
        at_places, cosine: of the places of shapes, and cos θi there. (rows, places) float32
        x, z: of ωi there. (rows, n) float32. area: solid angles. (n,) float32
    """

    quadrature: Quadrature
    moments: F64
    at_places: Quadrature
    cosine: F64
    x: F32
    z: F32
    area: F32


@lru_cache(maxsize=1)
def _even() -> _Even:
    wi, wo, moments = _about_lobe(0.0, _SPOKES // 2)
    x, z = (np.ascontiguousarray(part, np.float32) for part in (-wi[..., 0], wi[..., 2]))
    at, _ = about_mirror(places(), 0.0)
    cosine = np.maximum(at[..., 2], 0)
    area = _about_mirror(_SPOKES // 2)[1].astype(np.float32)
    return _Even(Quadrature(wi, wo), moments, Quadrature(at, wo), cosine, x, z, area)


def _about_lobe(phi: float, num_spokes: int) -> tuple[F64, F64, F64]:
    """Spread directions about the mirror directions of eyes in all rows.

    Args:
        phi: φo of the eyes. num_spokes: of the directions about each.
    Returns:
        ωi (rows, n, 3); ωo (rows, 1, 3); weights of cos θi dωi, and times x and z, with x what ωi goes away from the
        eye along the surface, and z = cos θi (rows, n, 3).
    """
    away, area = _about_mirror(num_spokes)
    wi, wo = about_mirror(away, phi)
    x, z = -(wi @ [np.cos(phi), np.sin(phi), 0]), wi[..., 2]
    weight = np.maximum(z, 0) * area
    return wi, wo, np.stack([weight, weight * x, weight * z], axis=-1)


def _eyes(document: Mapping[str, Any]) -> list[tuple[float, float]]:
    """φo of the eyes over which a term that is not isotropic is averaged, and the share of each."""
    phi, times = np.arange(_EYES) * (2 * np.pi / _EYES), np.ones(_EYES)  # how many eyes each stands for
    if is_mirrored(document):
        phi, times = phi[: _EYES // 4 + 1], np.array([2.0, *[4.0] * (_EYES // 4 - 1), 2.0])
    return [*zip(phi.tolist(), (times / times.sum()).tolist(), strict=True)]


def _moments_of(document: Mapping[str, Any]) -> F64:
    """∫ ρ (1, x, z) cos θi dωi, the mean over φo. (channels, rows, 3)"""
    total = np.zeros((3, NUM_ROWS, 3))
    for phi, share in _eyes(document):
        wi, wo, moments = _about_lobe(phi, _SPOKES)
        total += share * np.einsum("rnc,rnk->crk", eval_brdf(document, wi, wo), moments, optimize=True)
    return total


def _at_places_of(document: Mapping[str, Any]) -> F64:
    """ρ cos θi at the places of shapes, the mean over channels, φo and both sides of it. (rows, places)"""
    total = np.zeros((NUM_ROWS, NUM_PLACES))
    for phi, share in _eyes(document):
        for away in (places(), places() * [1, -1, 1]):
            wi, wo = about_mirror(away, phi)
            total += share / 2 * eval_brdf(document, wi, wo).mean(axis=-1) * np.maximum(wi[..., 2], 0)
    return total


@lru_cache(maxsize=_MOST_KNOWN)
def _lobe_of(term_text: str) -> F64:
    """a of each channel; cos θ of both lobes, s_1, σ of both; cos θm, √(1 − R). (`NUM_ROWS`, 10)"""
    document = json.loads(term_text)
    if not of_white(document).is_isotropic:
        moments = _moments_of(document)
        mean, wide = _one_of(moments)
        return np.column_stack([moments[..., 0].T, mean, mean, np.full(NUM_ROWS, 0.5), wide, wide, mean, wide])
    even = _even()
    value = even.quadrature.values(document)
    moments = (value[..., None, :] @ even.moments)[..., 0, :]
    sent = np.maximum(value.mean(axis=0) * even.z, 0).astype(np.float32)
    albedo = np.broadcast_to(moments[..., 0], (3, NUM_ROWS)).T
    return np.column_stack([albedo, fit_two(even.x, even.z, even.area, sent), *_one_of(moments)])


@lru_cache(maxsize=_MOST_KNOWN)
def _at_places(term_text: str) -> F64:
    """ρ cos θi at the places of shapes, the mean over channels. (`NUM_ROWS`, `NUM_PLACES`)"""
    document, even = json.loads(term_text), _even()
    if not of_white(document).is_isotropic:
        return _at_places_of(document)
    return np.asarray(even.at_places.values(document).mean(axis=0) * even.cosine)


def _one_of(moments: F64) -> tuple[F64, F64]:
    """Find cos θm and √(1 − R) from moments, (channels, rows, 3). (rows,) each"""
    sent, x, z = moments.mean(axis=0).T
    length = np.hypot(x, z)
    return z / np.maximum(length, 1e-30), np.sqrt(np.maximum(1 - length / np.maximum(sent, 1e-30), 1e-8))
