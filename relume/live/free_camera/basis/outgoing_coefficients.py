"""Outgoing BRDF coefficients ("out-going factors") of the hemispherical basis (Mahajan 2008; Sun 2007).

    p_k(ωo) = ∫ ρ(ωi, ωo) cos θi h_k(ωi) dωi,   B(ωo) = Σ_k p_k(ωo) t_k

For an isotropic term, rotating incident light by φ rotates outgoing light by φ, so its coefficients are tables over θo
alone, times cos mφ and sin mφ. Other terms have tables over θo and φo.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.brdf.frozen_term import FrozenTerm
from relume.brdf.quadrature import Quadrature
from relume.brdf.symmetry import has_reflection_symmetry, is_isotropic
from relume.math.zernike import DEGREE, NUM_FUNCTIONS, basis_functions, num_functions, recurrence

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NUM_ROWS = 32  # of tables, over sqrt(1 − cos θo) from 0 to 1
NUM_COLUMNS = 32  # over φo, for anisotropic terms
_NUM_RADII, _NUM_AZIMUTHS = 40, 96  # of the quadrature over the disc
_MIN_COSINE = 1e-3
_MAX_CACHED = 256
_WHITE = [1.0, 1.0, 1.0]


@dataclass(frozen=True)
class OutgoingCoefficients:
    """The table of one term.

    Attributes:
        table: one column, for φo = 0, if the term is isotropic.
        residual_by_degree: cosine-weighted RMS residual of the functions up to each degree, relative to the term's RMS,
            mean over θo; in [0, 1].
    """

    table: Shaped[F32, "rows columns 3 K"]
    residual_by_degree: tuple[float, ...]

    @property
    def is_isotropic(self) -> bool:
        """True if the term is invariant under rotation and reflection about the normal."""
        return bool(self.table.shape[1] == 1)

    @property
    def residual_energy(self) -> float:
        """Residual of all K functions."""
        return self.residual_by_degree[-1]


def cosines() -> Shaped[F64, " rows"]:
    """Return cos θo of the rows of a table."""
    return np.maximum(1 - np.linspace(0, 1, NUM_ROWS) ** 2, _MIN_COSINE)


@lru_cache(maxsize=2)
def _disk_quadrature(is_half: bool) -> tuple[F64, F64, F64]:
    """Distribute directions over the disk, or over half of it for symmetric terms.

    Returns:
        Unit directions (n, 3), weights of cos θ dω (n,), functions (n, K); functions that cancel over both halves are
        0.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_NUM_RADII)
    num_azimuths = _NUM_AZIMUTHS // 2 if is_half else _NUM_AZIMUTHS
    r2, phi = (
        np.repeat((nodes + 1) / 2, num_azimuths),
        np.tile((np.arange(num_azimuths) + 0.5) * (2 * np.pi / _NUM_AZIMUTHS), _NUM_RADII),
    )
    wi = np.stack([np.sqrt(r2) * np.cos(phi), np.sqrt(r2) * np.sin(phi), np.sqrt(1 - r2)], axis=-1)
    functions, recurrence_table = basis_functions(wi), recurrence()
    if is_half:
        functions[:, recurrence_table.sine[recurrence_table.order > 0]] = 0
    return wi, np.repeat(weights / 4, num_azimuths) * (2 * np.pi / num_azimuths), functions


def outgoing_coefficients(term_document: Mapping[str, Any]) -> OutgoingCoefficients:
    """Project a term with its color, without its texture.

    Args:
        term_document: one term of a complete look.
    """
    white = white_coefficients(term_document)
    color = np.asarray(term_document["color"], np.float32)
    return OutgoingCoefficients(white.table * color[:, None], white.residual_by_degree)


def white_coefficients(term_document: Mapping[str, Any]) -> OutgoingCoefficients:
    """Project a term without its color and texture."""
    return _white_coefficients(untextured_white_term(term_document))


def untextured_white_term(term_document: Mapping[str, Any]) -> FrozenTerm:
    """Return a term without its color and texture, by which results are cached."""
    return FrozenTerm.from_document(term_document, color=_WHITE, texture=None)


@lru_cache(maxsize=_MAX_CACHED)
def _white_coefficients(term: FrozenTerm) -> OutgoingCoefficients:
    document = term.document
    is_term_isotropic = is_isotropic(document)
    is_quarter = not is_term_isotropic and has_reflection_symmetry(document)
    num_columns = 1 if is_term_isotropic else NUM_COLUMNS // 4 + 1 if is_quarter else NUM_COLUMNS
    phi = np.linspace(0, 2 * np.pi, NUM_COLUMNS + 1)[:num_columns]
    table, energy = _project_isotropic(document) if is_term_isotropic else _project_anisotropic(document, phi)
    captured_energy = np.cumsum((table**2).sum(axis=2), axis=-1)[..., [num_functions(n) - 1 for n in range(DEGREE + 1)]]
    residual = np.sqrt(np.clip(1 - captured_energy / np.maximum(energy, 1e-30)[..., None], 0, 1))
    ends = (
        np.where(np.isin(np.arange(num_columns), (0, num_columns - 1)), 0.5, 1.0)
        if is_quarter
        else np.ones(num_columns)
    )
    by_degree = np.average(np.average(residual, weights=ends, axis=1), weights=cosines(), axis=0)
    full_table = _expand_quarter(table) if is_quarter else table
    return OutgoingCoefficients(full_table.astype(np.float32), tuple(by_degree.tolist()))


def _view_directions(phi: F64) -> F64:
    """ωo of all rows for some φo. (`NUM_ROWS`, columns, 3)"""
    cosine = np.broadcast_to(cosines()[:, None], (NUM_ROWS, len(phi)))
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=-1)


@lru_cache(maxsize=1)
def _isotropic_quadrature() -> tuple[Quadrature, F32, F32]:
    """Quadrature for isotropic terms; weights (n,); weighted functions of the cosine entries, (n, entries)."""
    wi, weight, functions = _disk_quadrature(is_half=True)
    weighted_functions = weight[:, None] * functions[:, recurrence().cosine]
    return (
        Quadrature(wi, _view_directions(np.zeros(1))),
        weight.astype(np.float32),
        np.ascontiguousarray(weighted_functions, np.float32),
    )


def _project_isotropic(document: Mapping[str, Any]) -> tuple[F64, F64]:
    """Project an isotropic term for all rows and φo = 0: coefficients (rows, 1, 3, K), energies (rows, 1)."""
    quadrature, weight, weighted_functions = _isotropic_quadrature()
    value = quadrature.values(document).astype(np.float32)  # (channels, rows, n)
    table = np.zeros((NUM_ROWS, 1, 3, NUM_FUNCTIONS))
    table[..., recurrence().cosine] = np.swapaxes(value @ weighted_functions, 0, 1)[:, None]
    return table, np.broadcast_to(value**2 @ weight, (3, NUM_ROWS)).sum(axis=0)[:, None]


def _project_anisotropic(document: Mapping[str, Any], phi: F64) -> tuple[F64, F64]:
    """Project a term for all rows and some φo: coefficients (rows, columns, 3, K), energies (rows, columns)."""
    wo, (wi, weight, functions) = _view_directions(phi), _disk_quadrature(is_half=False)
    table, energy = np.empty((NUM_ROWS, len(phi), 3, NUM_FUNCTIONS)), np.empty((NUM_ROWS, len(phi)))
    weighted_functions = weight[:, None] * functions
    for row in range(NUM_ROWS):  # one row at a time, so that arrays take a few megabytes
        value = np.moveaxis(eval_brdf(document, wi, wo[row, :, None]), -1, -2)  # (columns, 3, directions)
        table[row] = value @ weighted_functions
        energy[row] = (value**2 @ weight).sum(axis=-1)
    return table, energy


def _expand_quarter(quarter: Shaped[F64, "rows quarter_columns channels K"]) -> Shaped[F64, "rows columns channels K"]:
    """Return the outgoing coefficients of a reflection-symmetric term for all φo from those of a quadrant.

    Args:
        quarter: for φo from 0 to π/2, both included.
    Returns:
        For φo from 0 to 2π, end excluded: four times as many columns less the repeated ones.
    """
    recurrence_table = recurrence()
    across, along = np.ones((2, NUM_FUNCTIONS))  # signs of the functions under x → −x and y → −y
    across[recurrence_table.cosine] = (-1.0) ** recurrence_table.order
    odd = recurrence_table.order > 0
    across[recurrence_table.sine[odd]] = -((-1.0) ** recurrence_table.order[odd])
    along[recurrence_table.sine[odd]] = -1
    half = np.concatenate([quarter, across * quarter[:, -2::-1]], axis=1)
    return np.concatenate([half, along * half[:, -2:0:-1]], axis=1)
