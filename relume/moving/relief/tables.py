"""The out-factors of texels: what each sends to the eye of each function of the in-basis (Müller 2004).

    p_k(ωo, x) = Σ_v hat_v(ωo) Σ_j α_vj(x) ∫ E_vj(ωi) h_k(ωi) dωi

E holds the cosine, by which light vectors are weighed, so that B(x, ωo) = Σ_k p_k(ωo, x) t_k as of other materials.
Values of E are linear between the directions that it is known in; so are their integrals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import in_basis, num_functions
from relume.brdf.registry import TERMS
from relume.brdf.terms.btf import Texels
from relume.btf.eigen import EigenBtf
from relume.btf.rings import Rings, taps_numpy

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

DEGREE = 4  # of the in-basis, as of harmonics in the paper: a BTF tells no light apart that is much narrower
NUM_FUNCTIONS = num_functions(DEGREE)
WIDTH = 16  # F: with nothing behind them, so that kernels' loops are as long as a processor's vectors
COMPONENTS = 5  # C: that are enough while the eye moves; `relume.moving.relief.show` sums them in one line
_AROUND, _DOWN = 180, 90  # directions of the quadrature


class ReliefTables(NamedTuple):
    """The out-factors of a BTF, with as many components as are enough while the eye moves.

    Attributes:
        factors: from each side of each cluster: the mean, then each component, nothing where there are fewer; channels
            outermost. (V, K, 1 + C, 3 F) float32
        mean: of all texels. (V, 3 F) float32
    """

    factors: F32
    mean: F32


class Cover(NamedTuple):
    """A BTF on a material.

    Attributes:
        material: its number. texels: how they lie on it. tables: of it.
        color: that it is tinted with. (3,) float32. is_alone: whether the material has no other terms.
    """

    material: int
    texels: Texels
    tables: ReliefTables
    color: F32
    is_alone: bool


def covers_of(materials: Sequence[Sequence[Mapping[str, Any]]]) -> list[Cover]:
    """Find what covers materials.

    Args:
        materials: the terms of each, of a complete look.
    """
    found = []
    for index, terms in enumerate(materials):
        for term in terms:
            texels = TERMS[term["model"]].settled(term).texels
            if texels is not None:
                color = np.asarray(term["color"], np.float32)
                found.append(Cover(index, texels, _tables_of(texels.btf), color, len(terms) == 1))
    return found


@lru_cache(maxsize=3)
def _tables_of(whole: EigenBtf) -> ReliefTables:
    found, integrals = whole.with_components(COMPONENTS), hat_factors(whole.rings).astype(np.float32)
    tables = found.tables() @ integrals
    factors = np.zeros((*tables.shape[:2], 1 + COMPONENTS, 3 * WIDTH), np.float32)
    factors[:, :, : tables.shape[2]] = tables.reshape(*tables.shape[:3], -1)
    mean = np.einsum("vlc,lk->vck", whole.average, integrals)
    return ReliefTables(factors, np.ascontiguousarray(mean.reshape(len(mean), -1)))


def hat_factors(rings: Rings) -> F64:
    """Integrate functions of the in-basis with the weights by which values between directions are found.

    Args:
        rings: of the directions.
    Returns:
        (L, F), nothing beyond the functions.
    """
    z, phi = (np.arange(_DOWN) + 0.5) / _DOWN, (np.arange(_AROUND) + 0.5) * (2 * np.pi / _AROUND)
    z, phi = (grid.ravel() for grid in np.meshgrid(z, phi))
    sine = np.sqrt(1 - z**2)
    wi = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=1)
    index, weight, left = taps_numpy(rings, wi)
    functions = in_basis(wi)[:, :NUM_FUNCTIONS] * (left * (2 * np.pi / len(z)))[:, None]
    out = np.zeros((rings.num_directions, WIDTH))
    for tap in range(index.shape[1]):
        np.add.at(out[:, :NUM_FUNCTIONS], index[:, tap], weight[:, tap, None] * functions)
    return out
