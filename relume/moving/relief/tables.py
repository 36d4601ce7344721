"""The out-factors of texels: what each sends to the eye of each function of the in-basis (Müller 2004).

    p_k(ωo, x) = Σ_v hat_v(ωo) Σ_j α_vj(x) ∫ E_vj(ωi) h_k(ωi) dωi

E holds the cosine, by which light vectors are weighed, so that B(x, ωo) = Σ_k p_k(ωo, x) t_k as of other materials.
Values of E are linear between the directions that it is known in; so are their integrals. From each side a texel has
the numbers of `relume.moving.relief.numbers`, a byte each: by what its out-factors differ from those of the mean.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import in_basis
from relume.brdf.registry import TERMS
from relume.brdf.terms.btf import Texels
from relume.btf.eigen import LARGEST, EigenBtf
from relume.btf.rings import Rings, taps_numpy
from relume.btf.shelf import btf
from relume.memory import is_stored, stored
from relume.moving.relief.numbers import AXIS_OF, FUNCTIONS, LANE_OF, NUM_FUNCTIONS, NUMBERS, WIDTH
from relume.parallel import for_ranges
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_AROUND, _DOWN = 180, 90  # directions of the quadrature
_MOST_BYTES = 1 << 30  # of a table; of larger ones the finest texels are left out
_LOOKED_AT = 9, 256  # views and texels of each that axes of colours are found by
_LEAST = np.float32(1e-30)
_KIND = "BTF tables of the free camera"  # among what is stored


class ReliefTables(NamedTuple):
    """The out-factors of a BTF.

    Attributes:
        levels: of the texels that are here, see `EigenBtf`. (levels, 3) int32
        weight: numbers of each, less the mean's, in steps. (V, texels, 24) int8. step: (V, 24) float32
        axes: of colours; orthonormal columns. (3, 3) float32
    """

    levels: NDArray[np.int32]
    weight: NDArray[np.int8]
    step: F32
    axes: F32


class Cover(NamedTuple):
    """A BTF on a material.

    Attributes:
        material: its number. texels: how they lie on it. tables: of it.
        color: that it is tinted with. (3,) float32
    """

    material: int
    texels: Texels
    tables: ReliefTables
    color: F32


class Covers(NamedTuple):
    """What covers the materials of a look.

    Attributes:
        shown: those whose tables are there. missing: texels whose tables are still to be made.
    """

    shown: Sequence[Cover]
    missing: Sequence[Texels]


def covers_of(
    materials: Sequence[Sequence[Mapping[str, Any]]], before: Sequence[Cover] = (), *, waits: bool = True
) -> Covers:
    """Find what covers materials.

    Args:
        materials: the terms of each, of a complete look. before: what covered those of another look.
        waits: whether tables are made that nobody has made, which takes as long as many frames; else they are missing.
    """
    found, missing = list[Cover](), list[Texels]()
    known = {(cover.texels.data, cover.texels.components): cover.tables for cover in before}
    for index, terms in enumerate(materials):
        for term in terms:
            texels = TERMS[term["model"]].settled(term).texels
            if texels is None:
                continue
            key = texels.data, texels.components
            tables = known.get(key)
            if tables is None and (waits or is_stored(_KIND, *key)):
                tables = known[key] = relief_tables(*key)
            if tables is None:
                missing.append(texels)
            else:
                found.append(Cover(index, texels, tables, np.asarray(term["color"], np.float32)))
    return Covers(found, missing)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _numbers_of(factors, cluster, weight, view, texel, out):  # type: ignore[no-untyped-def]
    """Sum the numbers of a texel from one side. factors: (K, 1 + C, 24) of that side. out: (24,)"""
    of = cluster[view, texel]
    for i in range(NUMBERS):
        out[i] = factors[of, 0, i]
    for j in range(weight.shape[2]):
        alpha = np.float32(weight[view, texel, j])
        for i in range(NUMBERS):
            out[i] += alpha * factors[of, 1 + j, i]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _weigh(factors, cluster, weight, view, step, out):  # type: ignore[no-untyped-def]
    """Round the numbers of all texels of `out` from one side. out: (texels, 24) int8. step: (24,), both written"""
    numbers, largest = np.empty(NUMBERS, np.float32), np.zeros(NUMBERS, np.float32)
    for texel in range(out.shape[0]):
        _numbers_of(factors, cluster, weight, view, texel, numbers)
        for i in range(NUMBERS):
            largest[i] = max(largest[i], abs(numbers[i]))
    for i in range(NUMBERS):
        step[i] = max(largest[i], _LEAST) / np.float32(LARGEST)
    for texel in range(out.shape[0]):
        _numbers_of(factors, cluster, weight, view, texel, numbers)
        for i in range(NUMBERS):
            out[texel, i] = np.int8(np.rint(numbers[i] / step[i]))


@stored(_KIND)
def relief_tables(data: str, components: int) -> ReliefTables:
    """The tables of a BTF of which some components are used, by the name of its data; made once, which takes seconds.

    Raises:
        NotFoundError: it is not here. MaterialError: its files are damaged.
    """
    return tables_of(btf(data).with_components(components))


def tables_of(whole: EigenBtf) -> ReliefTables:
    """Find the out-factors of all texels from all sides."""
    integrals, num_views = hat_factors(whole.rings).astype(np.float32), whole.rings.num_directions
    mean = np.einsum("vlc,lk->vck", whole.average, integrals)
    axes, levels = _axes_of(whole, mean, integrals), _levels_of(whole)
    texels = int((levels[:, 1] * levels[:, 2]).sum())
    first, weights = int(whole.levels[len(whole.levels) - len(levels), 0]), (num_views, texels, NUMBERS)
    found = ReliefTables(levels, np.empty(weights, np.int8), np.empty((num_views, NUMBERS), np.float32), axes)
    cluster, weight = whole.cluster[:, first:], whole.weight[:, first:]

    def weigh(start: int, stop: int) -> None:
        for view in range(start, stop):
            factors = in_numbers(_factors_from(whole, mean, integrals, view), axes)
            _weigh(factors, cluster, weight, view, found.step[view], found.weight[view])

    for_ranges(weigh, num_views, 1)
    return found


def _levels_of(whole: EigenBtf) -> NDArray[np.int32]:
    """Levels that there is room for, the first texel that is kept being number 0; the coarsest always."""
    sizes = whole.levels[:, 1].astype(np.int64) * whole.levels[:, 2]
    left = 0
    while left < len(sizes) - 1 and whole.rings.num_directions * int(sizes[left:].sum()) * NUMBERS > _MOST_BYTES:
        left += 1
    return np.ascontiguousarray(whole.levels[left:] - [whole.levels[left, 0], 0, 0], np.int32)


def _factors_from(whole: EigenBtf, mean: F32, integrals: F32, view: int) -> F32:
    """Out-factors from one side less those of the mean: of each cluster, then of a step of each component.

    Returns:
        (K, 1 + C, 3, F)
    """
    components = whole.eigen[view].astype(np.float32) * whole.step[view][..., None, None]
    both = np.concatenate([whole.mean[view][:, None].astype(np.float32), components], axis=1)
    factors = both.swapaxes(-1, -2) @ integrals
    factors[:, 0] -= mean[view]
    return factors


def _axes_of(whole: EigenBtf, mean: F32, integrals: F32) -> F32:
    """Axes of colours along which texels differ, those of most difference first, by some of them. (3, 3)"""
    (num_views, most), squares = _LOOKED_AT, np.zeros((3, 3))
    texels = np.arange(0, whole.cluster.shape[1], max(1, whole.cluster.shape[1] // most))
    for view in range(0, whole.rings.num_directions, max(1, whole.rings.num_directions // num_views)):
        factors = _factors_from(whole, mean, integrals, view)[whole.cluster[view, texels]]
        weights = np.insert(whole.weight[view, texels].astype(np.float32), 0, 1, axis=1)
        told = np.einsum("xj,xjck->xck", weights, factors)
        squares += np.einsum("xck,xdk->cd", told, told, dtype=np.float64)
    return np.ascontiguousarray(np.linalg.eigh(squares)[1][:, ::-1], np.float32)


def in_numbers(factors: F32, axes: F32) -> F32:
    """Bring out-factors to few numbers.

    Args:
        factors: in lanes. (…, 3, F). axes: of colours. (3, 3)
    Returns:
        (…, 24) float32
    """
    along = np.einsum("...ck,cm->...mk", factors, axes)
    return np.ascontiguousarray(along[..., AXIS_OF, LANE_OF], np.float32)


def hat_factors(rings: Rings) -> F64:
    """Integrate functions of the in-basis with the weights by which values between directions are found.

    Args:
        rings: of the directions.
    Returns:
        In lanes. (L, F)
    """
    z, phi = (np.arange(_DOWN) + 0.5) / _DOWN, (np.arange(_AROUND) + 0.5) * (2 * np.pi / _AROUND)
    z, phi = (grid.ravel() for grid in np.meshgrid(z, phi))
    sine = np.sqrt(1 - z**2)
    wi = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=1)
    index, weight, left = taps_numpy(rings, wi)
    functions = in_lanes(in_basis(wi)[:, :NUM_FUNCTIONS]) * (left * (2 * np.pi / len(z)))[:, None]
    out = np.zeros((rings.num_directions, WIDTH))
    for tap in range(index.shape[1]):
        np.add.at(out, index[:, tap], weight[:, tap, None] * functions)
    return out


def in_lanes(values: F64) -> F64:
    """Put what belongs to functions into lanes.

    Args:
        values: (…, functions)
    Returns:
        (…, F), nothing where no function is
    """
    return np.asarray(np.where(FUNCTIONS >= 0, values[..., FUNCTIONS], 0))
