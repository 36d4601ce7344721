"""Highlight lobes: the blurred reflection of the environment, in one or two lobes (after Sun 2007).

    L(ωo) = a(θo) · L̄(ωm, √(1 − R)),   a = ∫ ρ cos θi dωi,   R ωm = ∫ ωi ρ cos θi dωi / a

L̄ is the environment around a direction, blurred by a width; it is evaluated per pixel, and Σ_k p_k t_k per probe.
Probes evaluate more: most highlights have a core and a wide tail, and at grazing angles they are asymmetric and longer
in the plane of the view direction and the normal. Two isotropic lobes approximate this
(`relume.live.free_camera.basis.two_lobes`, docs/free-camera.md#highlights),

    L_2(ωo) = a(θo) · Σ_n s_n L̄(ω_n, σ_n),   s_1 + s_2 = 1 ,

and pixels use them too if both lobes differ. Terms that the basis does not represent are summed over lights by the
terms' shape (`relume.live.free_camera.basis.lobe_shapes`), or by L_2 if they are narrower than lights. L varies fastest
between probes, so outgoing radiance minus L is interpolated: B(pixel) = L(pixel) + Σ_probes w (B − L)
(docs/free-camera.md#highlights). All tables are over θo, like outgoing coefficients; terms that depend on φo are
averaged over it and get one lobe.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import compress
from typing import Any, NamedTuple, Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.brdf.frozen_term import FrozenTerm
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
    untextured_white_term,
    white_coefficients,
)
from relume.live.free_camera.basis.two_lobes import NUM_PARAMETERS, fit_two_lobes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NARROW_RESIDUAL = 0.1  # residual above which the basis does not represent a term; see `OutgoingCoefficients`
_REPRESENTABLE_RESIDUAL = (
    0.03  # residual up to which the basis represents environment highlights as well as lights do, in less time
)
_NARROW_ANISOTROPIC = 0.2  # `NARROW_RESIDUAL` of anisotropic terms, which one isotropic lobe fits worse
_HIGHLIGHT_CRITERION = 3, 0.15  # a degree, and its residual above which a term has a highlight
NUM_GROUPS = 1 + len(TEXTURES)
_NUM_RINGS, _NUM_AZIMUTHS = 64, 24  # of the quadrature about the mirror direction
_INNERMOST_ANGLE = 3e-4  # radians
_NUM_VIEW_AZIMUTHS = 8  # φo over which anisotropic terms are averaged
_MAX_CACHED = 256
_MIN_RESIDUAL = 1e-3
_NUM_SHAPE_PARAMETERS = NUM_PARAMETERS + 2
_MAX_WIDTH_RATIO = 1.5  # greatest ratio of widths at which one lobe replaces two
_MIN_VIEW_COSINE = 0.3  # cos θo above which that is checked; at grazing angles all lobes differ


class Lobes(NamedTuple):
    """The lobes of all materials, at most one pair each.

    Attributes:
        albedo: a, by groups of terms as in `relume.live.free_camera.shade_probes`.
        cosine: cos θ of ω_1 and ω_2, on the side of the mirror direction.
        first: s_1.
        sigma: σ_1 and σ_2, radians.
        mean: cos θm. single_sigma: √(1 − R), σ of one lobe for both.
        max_ratio: the basis's value for the environment is clamped to between 1/max_ratio and max_ratio times the
            lobe's;
            1: the basis does not represent the terms, so lights are summed instead.
        is_two: one lobe would be a bad fit.
        shape, flatness, lobe_confidence: T, α² and 1 − β of the whole highlight, see
            `relume.live.free_camera.basis.lobe_shapes`; 1 − β is 1 if the basis represents it.
        lobe_index: lobe of each material, −1 for none.
    """

    albedo: Shaped[F32, "lobes rows groups 3"]
    cosine: Shaped[F32, "lobes rows 2"]
    first: Shaped[F32, "lobes rows"]
    sigma: Shaped[F32, "lobes rows 2"]
    mean: Shaped[F32, "lobes rows"]
    single_sigma: Shaped[F32, "lobes rows"]
    max_ratio: Shaped[F32, " lobes"]
    is_two: Shaped[NDArray[np.bool_], " lobes"]
    shape: Shaped[F32, "lobes rows widths directions"]
    flatness: Shaped[F32, " lobes"]
    lobe_confidence: Shaped[F32, "lobes rows"]
    lobe_index: Shaped[NDArray[np.int32], " materials"]

    @classmethod
    def joined(cls, lobe_sets: Sequence[Lobes]) -> Self:
        """Concatenate the lobes of several sets of materials."""
        first = np.cumsum([0, *(len(lobes.albedo) for lobes in lobe_sets)])
        lobe_index = [
            lobes.lobe_index + np.where(lobes.lobe_index >= 0, row, 0)
            for lobes, row in zip(lobe_sets, first, strict=False)
        ]
        joined = cls(*(np.concatenate(arrays) for arrays in zip(*lobe_sets, strict=True)))
        return joined._replace(lobe_index=np.concatenate(lobe_index).astype(np.int32))


def is_narrow(coefficients: OutgoingCoefficients) -> bool:
    """Return whether the basis does not represent a term."""
    return coefficients.residual_energy > _residual_limit(coefficients)


def is_representable(terms: Sequence[Mapping[str, Any]]) -> bool:
    """Return whether the basis represents environment highlights: its residual is small, or moderate without a wide
    tail.

    Args:
        terms: the terms of the highlight, of a complete look.
    """
    return all(map(_is_term_representable, terms))


def _is_term_representable(term: Mapping[str, Any]) -> bool:
    coefficients = white_coefficients(term)
    return coefficients.residual_energy <= _REPRESENTABLE_RESIDUAL or not (
        is_narrow(coefficients) or _needs_two_lobes(_fit_lobe(untextured_white_term(term))[:, 6:8])
    )


def _needs_two_lobes(sigma: F64) -> bool:
    """Return whether one lobe would be a bad fit. sigma: sigma of both. (rows, 2)"""
    return bool((sigma.max(axis=1) > _MAX_WIDTH_RATIO * sigma.min(axis=1))[cosines() > _MIN_VIEW_COSINE].any())


def _residual_limit(coefficients: OutgoingCoefficients) -> float:
    return NARROW_RESIDUAL if coefficients.is_isotropic else _NARROW_ANISOTROPIC


def _has_highlight(coefficients: OutgoingCoefficients) -> bool:
    degree, bound = _HIGHLIGHT_CRITERION
    return coefficients.residual_by_degree[degree] > bound


def terms_in_lobe(coefficients: Sequence[OutgoingCoefficients]) -> list[bool]:
    """Select the terms of a material in its lobe: narrow ones; if there are none, those with a highlight.

    Args:
        coefficients: coefficients of each term.
    """
    narrow = [is_narrow(term) for term in coefficients]
    return narrow if any(narrow) else [_has_highlight(term) for term in coefficients]


def _max_ratio(terms: Sequence[Mapping[str, Any]]) -> float:
    """Greatest ratio of basis to lobe: larger for a smaller residual, 1 if the basis does not represent the
    environment.
    """
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
    """Sum the narrow terms of each material into one lobe; if there are none, those with a highlight.

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
        needs_grid = max_ratio[-1] == 1  # else the basis represents it
        for term in compress(terms, is_in_lobe):
            lobe_parameters = _fit_lobe(untextured_white_term(term))
            term_albedo = lobe_parameters[:, :3] * np.asarray(term["color"], np.float64)
            albedo_by_group[:, texture_slot(term)] += term_albedo
            weighted_parameters += term_albedo.mean(axis=1, keepdims=True) * lobe_parameters[:, 3:]
            if needs_grid:
                grid_values += np.mean(term["color"]) * _grid_values(untextured_white_term(term))
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
    """Distribute directions around a pole, for half as many azimuths only over y > 0.

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
    """Quadrature for isotropic terms.

    Attributes:
        quadrature: for φo = 0. moment_weights: for it, see `_lobe_quadrature`.
        grid_quadrature, cosine: at grid directions of shapes, and cos θi there. (rows, directions) float32
        x, z: x and z of ωi. (rows, n) float32. area: solid angles. (n,) float32
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
    """Distribute directions around the mirror directions of view directions in all rows.

    Args:
        phi: φo of the view directions. num_azimuths: number of azimuths of the directions around each.
    Returns:
        ωi (rows, n, 3); ωo (rows, 1, 3); weights of cos θi dωi, and times x and z (rows, n, 3). x points along the
        surface, away from the view direction; z = cos θi.
    """
    directions, area = _polar_grid(num_azimuths)
    wi, wo = rotate_to_mirror(directions, phi)
    x, z = -(wi @ [np.cos(phi), np.sin(phi), 0]), wi[..., 2]
    weight = np.maximum(z, 0) * area
    return wi, wo, np.stack([weight, weight * x, weight * z], axis=-1)


def _view_azimuths(document: Mapping[str, Any]) -> list[tuple[float, float]]:
    """φo over which an anisotropic term is averaged, and the weight of each."""
    # number of equivalent view azimuths
    phi, multiplicity = np.arange(_NUM_VIEW_AZIMUTHS) * (2 * np.pi / _NUM_VIEW_AZIMUTHS), np.ones(_NUM_VIEW_AZIMUTHS)
    if has_reflection_symmetry(document):
        phi, multiplicity = (
            phi[: _NUM_VIEW_AZIMUTHS // 4 + 1],
            np.array([2.0, *[4.0] * (_NUM_VIEW_AZIMUTHS // 4 - 1), 2.0]),
        )
    return [*zip(phi.tolist(), (multiplicity / multiplicity.sum()).tolist(), strict=True)]


def _anisotropic_moments(document: Mapping[str, Any]) -> F64:
    """∫ ρ (1, x, z) cos θi dωi, mean over φo. (channels, rows, 3)"""
    total = np.zeros((3, NUM_ROWS, 3))
    for phi, view_weight in _view_azimuths(document):
        wi, wo, moment_weights = _lobe_quadrature(phi, _NUM_AZIMUTHS)
        total += view_weight * np.einsum("rnc,rnk->crk", eval_brdf(document, wi, wo), moment_weights, optimize=True)
    return total


def _anisotropic_grid_values(document: Mapping[str, Any]) -> F64:
    """ρ cos θi at grid directions, mean over channels, φo and both sides. (rows, directions)"""
    total = np.zeros((NUM_ROWS, NUM_GRID_DIRECTIONS))
    for phi, view_weight in _view_azimuths(document):
        for directions in (grid_directions(), grid_directions() * [1, -1, 1]):
            wi, wo = rotate_to_mirror(directions, phi)
            total += view_weight / 2 * eval_brdf(document, wi, wo).mean(axis=-1) * np.maximum(wi[..., 2], 0)
    return total


@lru_cache(maxsize=_MAX_CACHED)
def _fit_lobe(term: FrozenTerm) -> F64:
    """a of each channel; cos θ of both lobes, s_1, σ of both; cos θm, √(1 − R). (`NUM_ROWS`, 10)"""
    document = term.document
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
def _grid_values(term: FrozenTerm) -> F64:
    """ρ cos θi at grid directions, mean over channels. (`NUM_ROWS`, `NUM_GRID_DIRECTIONS`)"""
    document, grid = term.document, _isotropic_grid()
    if not white_coefficients(document).is_isotropic:
        return _anisotropic_grid_values(document)
    return np.asarray(grid.grid_quadrature.values(document).mean(axis=0) * grid.cosine)


def _single_lobe(moments: F64) -> tuple[F64, F64]:
    """Return cos θm and √(1 − R) from moments, (channels, rows, 3). (rows,) each"""
    albedo, x, z = moments.mean(axis=0).T
    length = np.hypot(x, z)
    return z / np.maximum(length, 1e-30), np.sqrt(np.maximum(1 - length / np.maximum(albedo, 1e-30), 1e-8))
