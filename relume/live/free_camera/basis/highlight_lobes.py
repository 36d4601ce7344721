"""Lobes: highlights as light of a mirror that is blurred, or of two (after Sun 2007).

    L(ωo) = a(θo) · L̄(ωm, √(1 − R)),   a = ∫ ρ cos θi dωi,   R ωm = ∫ ωi ρ cos θi dωi / a

L̄ is the sky about a direction, blurred by a width; it is found for each pixel, where Σ_k p_k t_k is found for points.
Points find more: most highlights have a core and a wide skirt, and seen from aslant they are longer in the plane of the
eye and the normal than across it, and lean. Two round lobes stand for one there
(`relume.live.free_camera.basis.two_lobes`, docs/free-camera.md#highlights),

    L_2(ωo) = a(θo) · Σ_n s_n L̄(ω_n, σ_n),   s_1 + s_2 = 1 ,

and for each pixel, too, where both are not alike. What the in-basis cannot tell is summed over lights, by the shape of
the terms (`relume.live.free_camera.basis.lobe_shapes`), and where these are narrower than lights it is L_2. L is what
changes fastest from point to point, and what is sent less L is interpolated: B(pixel) = L(pixel) + Σ_points w (B − L)
(docs/free-camera.md#highlights). All stand in tables over θo, as out-factors do; of terms that depend on
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

from relume.brdf.evaluate import eval_brdf
from relume.brdf.quadrature import Quadrature
from relume.brdf.symmetry import has_reflection_symmetry
from relume.brdf.texture_slots import TEXTURES, texture_slot
from relume.live.free_camera.basis.lobe_shapes import (
    NUM_GRID_DIRECTIONS,
    build_shapes,
    grid_directions,
    rotate_to_mirror,
)
from relume.live.free_camera.basis.outgoing_coefficients import (
    NUM_ROWS,
    OutgoingCoefficients,
    cosines,
    white_coefficients,
    white_term_key,
)
from relume.live.free_camera.basis.two_lobes import NUM_PARAMETERS, fit_two_lobes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NARROW_RESIDUAL = 0.1  # what the in-basis misses of a term that it cannot tell, see `OutFactors.missed`
_REPRESENTABLE_RESIDUAL = (
    0.03  # the same, up to which it tells the sky in a highlight as well as lights do, in less time
)
_NARROW_ANISOTROPIC = 0.2  # the same of terms that are not isotropic, which one round lobe tells less of
_HIGHLIGHT_CRITERION = 3, 0.15  # a degree, and what its functions miss of a term that has a highlight
NUM_GROUPS = 1 + len(TEXTURES)
_NUM_RINGS, _NUM_AZIMUTHS = 64, 24  # of the quadrature about the mirror direction
_INNERMOST_ANGLE = 3e-4  # radians
_NUM_VIEW_AZIMUTHS = 8  # φo over which a term that is not isotropic is averaged
_MAX_CACHED = 256
_MIN_RESIDUAL = 1e-3
_NUM_SHAPE_PARAMETERS = NUM_PARAMETERS + 2
_MAX_WIDTH_RATIO = 1.5  # times as wide as the other is a lobe, at most, where one stands for both
_MIN_VIEW_COSINE = 0.3  # cos θo above which that counts: farther aslant all lobes are unlike


class Lobes(NamedTuple):
    """The lobes of all materials, one each.

    Attributes:
        albedo: a, by groups of terms as in `relume.live.free_camera.shade_probes`. (lobes, `NUM_ROWS`, groups, 3)
            float32
        cosine: cos θ of ω_1 and ω_2, on the side that the mirror direction is. (lobes, `NUM_ROWS`, 2) float32
        first: s_1. (lobes, `NUM_ROWS`) float32
        sigma: of both, radians. (lobes, `NUM_ROWS`, 2) float32
        mean: cos θm. (lobes, `NUM_ROWS`) float32. single_sigma: √(1 − R), σ of one lobe for both. (lobes, `NUM_ROWS`)
            float32
        max_ratio: what the in-basis says of the sky is believed up to so many times of what the lobe says, and down to
            that part of it; 1: it is not believed, since it cannot tell the terms: lights do. (lobes,) float32
        is_two: whether one lobe for both would stand for it badly. (lobes,) bool
        shape, flatness, lobe_confidence: of the whole, see `relume.live.free_camera.basis.lobe_shapes`: T, α², and 1 −
        β, which is one where
            the in-basis is believed. (lobes, `NUM_ROWS`, widths, places), (lobes,), (lobes, `NUM_ROWS`) float32
        lobe_index: lobe of each material, −1 for none. (materials,) int32
    """

    albedo: F32
    cosine: F32
    first: F32
    sigma: F32
    mean: F32
    single_sigma: F32
    max_ratio: F32
    is_two: NDArray[np.bool_]
    shape: F32
    flatness: F32
    lobe_confidence: F32
    lobe_index: NDArray[np.int32]

    @classmethod
    def joined(cls, lobe_sets: Sequence[Lobes]) -> Self:
        """Those of some materials, then of others."""
        first = np.cumsum([0, *(len(lobes.albedo) for lobes in lobe_sets)])
        lobe_index = [
            lobes.lobe_index + np.where(lobes.lobe_index >= 0, row, 0)
            for lobes, row in zip(lobe_sets, first, strict=False)
        ]
        joined = cls(*(np.concatenate(arrays) for arrays in zip(*lobe_sets, strict=True)))
        return joined._replace(lobe_index=np.concatenate(lobe_index).astype(np.int32))


def is_narrow(coefficients: OutgoingCoefficients) -> bool:
    """Whether the in-basis cannot tell a term. known: its factors"""
    return coefficients.residual_energy > _residual_limit(coefficients)


def is_representable(terms: Sequence[Mapping[str, Any]]) -> bool:
    """Whether the in-basis tells the sky in a highlight: it misses nothing, or little of one that has no skirt.

    Args:
        terms: that the highlight consists of, of a complete look.
    """
    return all(map(_is_term_representable, terms))


def _is_term_representable(term: Mapping[str, Any]) -> bool:
    coefficients = white_coefficients(term)
    return coefficients.residual_energy <= _REPRESENTABLE_RESIDUAL or not (
        is_narrow(coefficients) or _needs_two_lobes(_fit_lobe(white_term_key(term))[:, 6:8])
    )


def _needs_two_lobes(sigma: F64) -> bool:
    """Whether one lobe would stand for both badly. sigma: of both. (rows, 2)"""
    return bool((sigma.max(axis=1) > _MAX_WIDTH_RATIO * sigma.min(axis=1))[cosines() > _MIN_VIEW_COSINE].any())


def _residual_limit(coefficients: OutgoingCoefficients) -> float:
    return NARROW_RESIDUAL if coefficients.is_isotropic else _NARROW_ANISOTROPIC


def _has_highlight(coefficients: OutgoingCoefficients) -> bool:
    degree, bound = _HIGHLIGHT_CRITERION
    return coefficients.residual_by_degree[degree] > bound


def terms_in_lobe(coefficients: Sequence[OutgoingCoefficients]) -> list[bool]:
    """Tell which terms of a material its lobe stands for: narrow ones; if there are none, those with a highlight.

    Args:
        coefficients: the factors of each.
    """
    narrow = [is_narrow(term) for term in coefficients]
    return narrow if any(narrow) else [_has_highlight(term) for term in coefficients]


def _max_ratio(terms: Sequence[Mapping[str, Any]]) -> float:
    """What the in-basis is believed: any multiple where it misses nothing, none where it does not tell the sky."""
    if not is_representable(terms):
        return 1.0
    return max(
        1.0,
        min(
            _residual_limit(coefficients) / max(coefficients.residual_energy, _MIN_RESIDUAL)
            for coefficients in map(white_coefficients, terms)
        )
        ** 2,
    )


def build_lobes(materials: Sequence[Sequence[Mapping[str, Any]]]) -> Lobes:
    """Sum the narrow terms of each material to one lobe; where it has none, those with a highlight.

    Args:
        materials: the terms of each, of a complete look.
    """
    lobe_index = np.full(len(materials), -1, np.int32)
    albedo: list[F64] = []
    shape_parameters: list[F64] = []
    grid_densities: list[F64] = []
    max_ratio: list[float] = []
    for index, terms in enumerate(materials):
        coefficients = [white_coefficients(term) for term in terms]
        is_in_lobe = terms_in_lobe(coefficients)
        if not any(is_in_lobe):
            continue
        lobe_index[index] = len(albedo)
        max_ratio.append(_max_ratio([*compress(terms, is_in_lobe)]))
        albedo_by_group, weighted_parameters = (
            np.zeros((NUM_ROWS, NUM_GROUPS, 3)),
            np.zeros((NUM_ROWS, _NUM_SHAPE_PARAMETERS)),
        )
        grid_values = np.zeros((NUM_ROWS, NUM_GRID_DIRECTIONS))
        needs_grid = max_ratio[-1] == 1  # else the in-basis tells it
        for term in compress(terms, is_in_lobe):
            lobe_parameters = _fit_lobe(white_term_key(term))
            term_albedo = lobe_parameters[:, :3] * np.asarray(term["color"], np.float64)
            albedo_by_group[:, texture_slot(term)] += term_albedo
            weighted_parameters += term_albedo.mean(axis=1, keepdims=True) * lobe_parameters[:, 3:]
            if needs_grid:
                grid_values += np.mean(term["color"]) * _grid_values(white_term_key(term))
        total = albedo_by_group.sum(axis=1).mean(axis=1)[:, None]
        albedo.append(albedo_by_group)
        shape_parameters.append(np.where(total > 0, weighted_parameters / np.maximum(total, 1e-30), 1))
        grid_densities.append(np.where(total > 0, grid_values / np.maximum(total, 1e-30), 0))
    shapes = np.reshape(
        np.array(shape_parameters, np.float32), (len(shape_parameters), NUM_ROWS, _NUM_SHAPE_PARAMETERS)
    )
    cosine, sigma = (np.ascontiguousarray(shapes[..., k : k + 2]) for k in (0, 3))
    first, mean, single_sigma = (np.ascontiguousarray(shapes[..., k]) for k in (2, 5, 6))
    is_two = np.array([_needs_two_lobes(lobe_sigma) for lobe_sigma in sigma], np.bool_)
    lobe_shapes = build_shapes(
        grid_densities, [parameters[:, :NUM_PARAMETERS] for parameters in shape_parameters], np.array(max_ratio) > 1
    )
    return Lobes(
        np.reshape(np.array(albedo, np.float32), (len(albedo), NUM_ROWS, NUM_GROUPS, 3)),
        cosine, first, sigma, mean, single_sigma, np.array(max_ratio, np.float32), is_two, *lobe_shapes, lobe_index,
    )  # fmt: skip


@lru_cache(maxsize=2)
def _polar_grid(num_azimuths: int) -> tuple[F64, F64]:
    """Spread directions about a pole, over the half where y > 0 for what is the same on the other.

    Returns:
        Unit directions (n, 3) and solid angles (n,).
    """
    ring = np.geomspace(_INNERMOST_ANGLE, np.pi, _NUM_RINGS + 1)
    ring_angle, azimuth = np.sqrt(ring[1:] * ring[:-1]), (np.arange(num_azimuths) + 0.5) * (2 * np.pi / _NUM_AZIMUTHS)
    tangential = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(num_azimuths)], axis=-1)
    directions = np.sin(ring_angle)[:, None, None] * tangential + np.cos(ring_angle)[:, None, None] * [0, 0, 1]
    area = np.repeat((np.cos(ring[:-1]) - np.cos(ring[1:])) / num_azimuths * 2 * np.pi, num_azimuths)
    return directions.reshape(-1, 3), area


class _IsotropicGrid(NamedTuple):
    """Where isotropic terms are evaluated.

    Attributes:
        quadrature: for φo = 0. moment_weights: about it, see `_lobe_quadrature`.
        grid_quadrature, cosine: of the places of shapes, and cos θi there. (rows, places) float32
        x, z: of ωi there. (rows, n) float32. area: solid angles. (n,) float32
    """

    quadrature: Quadrature
    moment_weights: F64
    grid_quadrature: Quadrature
    cosine: F64
    x: F32
    z: F32
    area: F32


@lru_cache(maxsize=1)
def _isotropic_grid() -> _IsotropicGrid:
    wi, wo, moment_weights = _lobe_quadrature(0.0, _NUM_AZIMUTHS // 2)
    x, z = (np.ascontiguousarray(component, np.float32) for component in (-wi[..., 0], wi[..., 2]))
    grid_wi, _ = rotate_to_mirror(grid_directions(), 0.0)
    cosine = np.maximum(grid_wi[..., 2], 0)
    area = _polar_grid(_NUM_AZIMUTHS // 2)[1].astype(np.float32)
    return _IsotropicGrid(Quadrature(wi, wo), moment_weights, Quadrature(grid_wi, wo), cosine, x, z, area)


def _lobe_quadrature(phi: float, num_azimuths: int) -> tuple[F64, F64, F64]:
    """Spread directions about the mirror directions of eyes in all rows.

    Args:
        phi: φo of the eyes. num_azimuths: of the directions about each.
    Returns:
        ωi (rows, n, 3); ωo (rows, 1, 3); weights of cos θi dωi, and times x and z, with x what ωi goes away from the
        eye along the surface, and z = cos θi (rows, n, 3).
    """
    directions, area = _polar_grid(num_azimuths)
    wi, wo = rotate_to_mirror(directions, phi)
    x, z = -(wi @ [np.cos(phi), np.sin(phi), 0]), wi[..., 2]
    weight = np.maximum(z, 0) * area
    return wi, wo, np.stack([weight, weight * x, weight * z], axis=-1)


def _view_azimuths(document: Mapping[str, Any]) -> list[tuple[float, float]]:
    """φo of the eyes over which a term that is not isotropic is averaged, and the share of each."""
    # how many eyes each stands for
    phi, multiplicity = np.arange(_NUM_VIEW_AZIMUTHS) * (2 * np.pi / _NUM_VIEW_AZIMUTHS), np.ones(_NUM_VIEW_AZIMUTHS)
    if has_reflection_symmetry(document):
        phi, multiplicity = (
            phi[: _NUM_VIEW_AZIMUTHS // 4 + 1],
            np.array([2.0, *[4.0] * (_NUM_VIEW_AZIMUTHS // 4 - 1), 2.0]),
        )
    return [*zip(phi.tolist(), (multiplicity / multiplicity.sum()).tolist(), strict=True)]


def _anisotropic_moments(document: Mapping[str, Any]) -> F64:
    """∫ ρ (1, x, z) cos θi dωi, the mean over φo. (channels, rows, 3)"""
    total = np.zeros((3, NUM_ROWS, 3))
    for phi, view_weight in _view_azimuths(document):
        wi, wo, moment_weights = _lobe_quadrature(phi, _NUM_AZIMUTHS)
        total += view_weight * np.einsum("rnc,rnk->crk", eval_brdf(document, wi, wo), moment_weights, optimize=True)
    return total


def _anisotropic_grid_values(document: Mapping[str, Any]) -> F64:
    """ρ cos θi at the places of shapes, the mean over channels, φo and both sides of it. (rows, places)"""
    total = np.zeros((NUM_ROWS, NUM_GRID_DIRECTIONS))
    for phi, view_weight in _view_azimuths(document):
        for directions in (grid_directions(), grid_directions() * [1, -1, 1]):
            wi, wo = rotate_to_mirror(directions, phi)
            total += view_weight / 2 * eval_brdf(document, wi, wo).mean(axis=-1) * np.maximum(wi[..., 2], 0)
    return total


@lru_cache(maxsize=_MAX_CACHED)
def _fit_lobe(term_text: str) -> F64:
    """a of each channel; cos θ of both lobes, s_1, σ of both; cos θm, √(1 − R). (`NUM_ROWS`, 10)"""
    document = json.loads(term_text)
    if not white_coefficients(document).is_isotropic:
        moments = _anisotropic_moments(document)
        mean, single_sigma = _single_lobe(moments)
        return np.column_stack(
            [moments[..., 0].T, mean, mean, np.full(NUM_ROWS, 0.5), single_sigma, single_sigma, mean, single_sigma]
        )
    grid = _isotropic_grid()
    value = grid.quadrature.values(document)
    moments = (value[..., None, :] @ grid.moment_weights)[..., 0, :]
    brdf_cosine = np.maximum(value.mean(axis=0) * grid.z, 0).astype(np.float32)
    albedo = np.broadcast_to(moments[..., 0], (3, NUM_ROWS)).T
    return np.column_stack([albedo, fit_two_lobes(grid.x, grid.z, grid.area, brdf_cosine), *_single_lobe(moments)])


@lru_cache(maxsize=_MAX_CACHED)
def _grid_values(term_text: str) -> F64:
    """ρ cos θi at the places of shapes, the mean over channels. (`NUM_ROWS`, `NUM_GRID_DIRECTIONS`)"""
    document, grid = json.loads(term_text), _isotropic_grid()
    if not white_coefficients(document).is_isotropic:
        return _anisotropic_grid_values(document)
    return np.asarray(grid.grid_quadrature.values(document).mean(axis=0) * grid.cosine)


def _single_lobe(moments: F64) -> tuple[F64, F64]:
    """Find cos θm and √(1 − R) from moments, (channels, rows, 3). (rows,) each"""
    albedo, x, z = moments.mean(axis=0).T
    length = np.hypot(x, z)
    return z / np.maximum(length, 1e-30), np.sqrt(np.maximum(1 - length / np.maximum(albedo, 1e-30), 1e-8))
