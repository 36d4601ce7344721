"""Out-factors: what materials send to the eye of each function of the in-basis (Mahajan 2008; Sun 2007).

    p_k(ωo) = ∫ ρ(ωi, ωo) cos θi h_k(ωi) dωi,   B(ωo) = Σ_k p_k(ωo) t_k

Light that comes from a direction φ further round is seen a φ further round, so that the factors of an isotropic term
are tables over θo alone, times cos mφ and sin mφ. Those of other terms are tables over θo and φo.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.moving.basis.zernike import DEGREE, NUM_FUNCTIONS, in_basis, ladder, num_functions

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NUM_ROWS = 32  # of tables, over sqrt(1 − cos θo) from 0 to 1
NUM_COLUMNS = 32  # over φo, where a term is not isotropic
_RADII, _TURNS = 40, 96  # of the quadrature over the disc
_LEAST_COSINE = 1e-3
_ISOTROPIC = 1e-6  # relative difference of a term turned by an angle that no symmetry has
_MOST_KNOWN = 256


@dataclass(frozen=True)
class OutFactors:
    """The table of one term.

    Attributes:
        table: (`NUM_ROWS`, columns, 3, K) float32; of one column, for φo = 0, where the term is isotropic.
        missed_by_degree: what the functions up to each degree miss of the term, cosine-weighted RMS over its own, the
            mean over θo; in [0, 1].
    """

    table: F32
    missed_by_degree: tuple[float, ...]

    @property
    def missed(self) -> float:
        """What all K functions miss."""
        return self.missed_by_degree[-1]


def cosines() -> F64:
    """Of θo, in the rows of a table. (`NUM_ROWS`,)"""
    return np.maximum(1 - np.linspace(0, 1, NUM_ROWS) ** 2, _LEAST_COSINE)


@lru_cache(maxsize=2)
def _disc(is_half: bool) -> tuple[F64, F64, F64]:
    """Spread directions over the disc, or over half of it for what is the same on the other.

    Returns:
        Unit directions (n, 3), weights of cos θ dω (n,), functions (n, K); those that the halves cancel are nothing.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_RADII)
    turns = _TURNS // 2 if is_half else _TURNS
    r2, phi = np.repeat((nodes + 1) / 2, turns), np.tile((np.arange(turns) + 0.5) * (2 * np.pi / _TURNS), _RADII)
    wi = np.stack([np.sqrt(r2) * np.cos(phi), np.sqrt(r2) * np.sin(phi), np.sqrt(1 - r2)], axis=-1)
    functions, rungs = in_basis(wi), ladder()
    if is_half:
        functions[:, rungs.sine[rungs.order > 0]] = 0
    return wi, np.repeat(weights / 4, turns) * (2 * np.pi / turns), functions


def out_factors(term_document: Mapping[str, Any]) -> OutFactors:
    """Project a term, its colour included, its texture not.

    Args:
        term_document: one term of a complete look.
    """
    white = {**term_document, "color": [1.0, 1.0, 1.0], "texture": None}
    known = _of_white(json.dumps(white, sort_keys=True))
    color = np.asarray(term_document["color"], np.float32)
    return OutFactors(known.table * color[:, None], known.missed_by_degree)


@lru_cache(maxsize=_MOST_KNOWN)
def _of_white(term_text: str) -> OutFactors:
    document = json.loads(term_text)
    cosine = cosines()
    sine = np.sqrt(1 - cosine**2)
    is_even = _is_isotropic(document)
    phi = np.zeros(1) if is_even else np.arange(NUM_COLUMNS) * (2 * np.pi / NUM_COLUMNS)
    wo = np.stack(
        [
            sine[:, None] * np.cos(phi),
            sine[:, None] * np.sin(phi),
            np.broadcast_to(cosine[:, None], (NUM_ROWS, len(phi))),
        ],
        axis=-1,
    )
    wi, weight, functions = _disc(is_even)
    table = np.empty((NUM_ROWS, len(phi), 3, NUM_FUNCTIONS))
    whole = np.empty((NUM_ROWS, len(phi)))
    for row in range(NUM_ROWS):
        value = eval_brdf(document, wi, wo[row][:, None])  # (columns, directions, 3)
        table[row] = np.einsum("pnc,n,nk->pck", value, weight, functions, optimize=True)
        whole[row] = np.einsum("pnc,n->p", value**2, weight)
    kept = np.cumsum((table**2).sum(axis=2), axis=-1)[..., [num_functions(n) - 1 for n in range(DEGREE + 1)]]
    missed = np.sqrt(np.clip(1 - kept / np.maximum(whole, 1e-30)[..., None], 0, 1)).mean(axis=1)
    by_degree = np.average(missed, weights=cosine, axis=0)
    return OutFactors(table.astype(np.float32), tuple(by_degree.tolist()))


def _is_isotropic(document: Mapping[str, Any]) -> bool:
    """Whether a term looks the same when both directions turn about the normal, or are mirrored."""
    rng = np.random.default_rng(1)
    wi, wo = (np.abs(rng.normal(size=(256, 3))) * [1, 1, 1] for _ in range(2))
    wi[:128, 0] *= -1
    wi, wo = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (wi, wo))
    cosine, sine = np.cos(1.2345), np.sin(1.2345)
    turned = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    plain = eval_brdf(document, wi, wo)
    others = (eval_brdf(document, wi @ turned.T, wo @ turned.T), eval_brdf(document, wi * [1, -1, 1], wo * [1, -1, 1]))
    scale = np.abs(plain).max() + 1e-30
    return all(np.abs(other - plain).max() <= _ISOTROPIC * scale for other in others)


def turned(row: F64, phi: float) -> F64:
    """Turn the factors of an isotropic term for φo = 0, (..., K), to another φo: what kernels do, in NumPy."""
    rungs, out = ladder(), np.array(row, np.float64)
    for rung, m in enumerate(rungs.order):
        if m > 0:
            out[..., rungs.sine[rung]] = row[..., rungs.cosine[rung]] * np.sin(m * phi)
            out[..., rungs.cosine[rung]] = row[..., rungs.cosine[rung]] * np.cos(m * phi)
    return out
