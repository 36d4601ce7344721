"""Outgoing BRDF coefficients of BTF texels in the Zernike basis (Müller 2004, Mahajan 2008).

    p_k(ωo, x) = Σ_v w_v(ωo) Σ_j α_vj(x) ∫ E_vj(ωi) h_k(ωi) dωi

E includes the cosine, which the coefficients of incident radiance do not, so that B(x, ωo) = Σ_k p_k(ωo, x) t_k as for
other materials. E is linear between the measured directions, and so are its integrals. For each view direction a texel
stores the packed numbers of `relume.live.free_camera.texel_brdf.coefficient_packing`, one byte each: the difference
between its coefficients and those of the mean texel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.btf_store import load_btf
from relume.assets.btf.direction_rings import DirectionGrid, interpolation_weights_numpy
from relume.assets.btf.local_pca_btf import INT8_MAX, LocalPcaBtf
from relume.brdf.registry import TERMS
from relume.brdf.terms.btf import BtfRef
from relume.core.cache import asset_cached, is_asset_cached
from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.live.free_camera.texel_brdf.coefficient_packing import (
    COEFFICIENT_AXIS,
    COEFFICIENT_LANE,
    FUNCTIONS,
    NUM_COEFFICIENTS,
    NUM_FUNCTIONS,
    WIDTH,
)
from relume.live.free_camera.texel_brdf.visible_relief import VisibleRelief, see_relief
from relume.math.zernike import basis_functions

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NUM_AZIMUTHS, _NUM_ELEVATIONS = 180, 90  # directions of the quadrature
_MAX_TABLE_BYTES = 1 << 30  # of a table; larger ones omit the finest mip levels
_AXES_SUBSET = 9, 256  # views, and texels per view, that the color axes are fitted to
_EPSILON = np.float32(1e-30)
_KIND = "BTF tables of the free camera"  # key of the cache


class TexelTables(NamedTuple):
    """Outgoing BRDF coefficients of a BTF.

    Attributes:
        levels: mip levels that are stored, see `LocalPcaBtf`.
        weight: packed coefficients of each texel minus those of the mean, in steps. step: step of each coefficient.
        axes: orthonormal columns of the color space in which coefficients are packed.
        relief: heights that the view directions see.
    """

    levels: Shaped[NDArray[np.int32], "levels 3"]
    weight: Shaped[NDArray[np.int8], "views texels 24"]
    step: Shaped[F32, "views 24"]
    axes: Shaped[F32, "3 3"]
    relief: VisibleRelief


class BtfMaterial(NamedTuple):
    """A BTF on a material.

    Attributes:
        material: index of the material. texels: the BTF and its placement. tables: tables of the BTF. color: tint.
    """

    material: int
    texels: BtfRef
    tables: TexelTables
    color: Shaped[F32, " 3"]


class BtfMaterials(NamedTuple):
    """The BTF materials of a look.

    Attributes:
        available: those whose tables are computed. missing: BTFs whose tables must be computed first.
    """

    available: Sequence[BtfMaterial]
    missing: Sequence[BtfRef]


def find_btf_materials(
    materials: Sequence[Sequence[Mapping[str, Any]]], previous: Sequence[BtfMaterial] = (), *, is_blocking: bool = True
) -> BtfMaterials:
    """Find the BTF materials of a look.

    Args:
        materials: the terms of each material, of a complete look. previous: the result for an earlier look.
        is_blocking: compute missing tables, which takes as long as many frames; otherwise report them as missing.
    """
    available, missing = list[BtfMaterial](), list[BtfRef]()
    cached_tables = {
        (btf_material.texels.data, btf_material.texels.components): btf_material.tables for btf_material in previous
    }
    for index, terms in enumerate(materials):
        for term in terms:
            texels = TERMS[term["model"]].normalized(term).texels
            if texels is None:
                continue
            key = texels.data, texels.components
            tables = cached_tables.get(key)
            if tables is None and (is_blocking or is_asset_cached(_KIND, *key)):
                tables = cached_tables[key] = get_texel_tables(*key)
            if tables is None:
                missing.append(texels)
            else:
                available.append(BtfMaterial(index, texels, tables, np.asarray(term["color"], np.float32)))
    return BtfMaterials(available, missing)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _texel_coefficients(factors, cluster, weight, view, texel, out):  # type: ignore[no-untyped-def]
    """Sum the coefficients of a texel for one view direction. factors: (K, 1 + C, 24) of that direction. out: (24,)"""
    cluster_index = cluster[view, texel]
    for i in range(NUM_COEFFICIENTS):
        out[i] = factors[cluster_index, 0, i]
    for j in range(weight.shape[2]):
        alpha = np.float32(weight[view, texel, j])
        for i in range(NUM_COEFFICIENTS):
            out[i] += alpha * factors[cluster_index, 1 + j, i]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _quantize(factors, cluster, weight, view, step, out):  # type: ignore[no-untyped-def]
    """Round the coefficients of all texels for one view direction. out: (texels, 24) int8. step: (24,), both written"""
    coefficients, largest = np.empty(NUM_COEFFICIENTS, np.float32), np.zeros(NUM_COEFFICIENTS, np.float32)
    for texel in range(out.shape[0]):
        _texel_coefficients(factors, cluster, weight, view, texel, coefficients)
        for i in range(NUM_COEFFICIENTS):
            largest[i] = max(largest[i], abs(coefficients[i]))
    for i in range(NUM_COEFFICIENTS):
        step[i] = max(largest[i], _EPSILON) / np.float32(INT8_MAX)
    for texel in range(out.shape[0]):
        _texel_coefficients(factors, cluster, weight, view, texel, coefficients)
        for i in range(NUM_COEFFICIENTS):
            out[texel, i] = np.int8(np.rint(coefficients[i] / step[i]))


@asset_cached(_KIND)
def get_texel_tables(data: str, components: int) -> TexelTables:
    """Return the tables of a BTF with its first `components` components, cached; computing them takes seconds.

    Raises:
        NotFoundError: there is no such BTF. MaterialError: its files are damaged.
    """
    return compute_texel_tables(load_btf(data).with_components(components))


def compute_texel_tables(pca_btf: LocalPcaBtf) -> TexelTables:
    """Compute the outgoing coefficients of all texels for all view directions."""
    integrals, num_views = filtered_factors(pca_btf.grid).astype(np.float32), pca_btf.grid.num_directions
    mean = np.einsum("vlc,lk->vck", pca_btf.average, integrals)
    axes, levels = _color_axes(pca_btf, mean, integrals), _fitting_levels(pca_btf)
    texels = int((levels[:, 1] * levels[:, 2]).sum())
    first, weights = int(pca_btf.levels[len(pca_btf.levels) - len(levels), 0]), (num_views, texels, NUM_COEFFICIENTS)
    steps, relief = np.empty((num_views, NUM_COEFFICIENTS), np.float32), see_relief(pca_btf, levels)
    tables = TexelTables(levels, np.empty(weights, np.int8), steps, axes, relief)
    cluster, weight = pca_btf.cluster[:, first:], pca_btf.weight[:, first:]

    def weigh(start: int, stop: int) -> None:
        for view in range(start, stop):
            factors = pack(_view_factors(pca_btf, mean, integrals, view), axes)
            _quantize(factors, cluster, weight, view, tables.step[view], tables.weight[view])

    for_ranges(weigh, num_views, 1)
    return tables


def _fitting_levels(pca_btf: LocalPcaBtf) -> NDArray[np.int32]:
    """Return the mip levels that fit the memory bound, texels counted from the first of them; always the coarsest."""
    sizes = pca_btf.levels[:, 1].astype(np.int64) * pca_btf.levels[:, 2]
    first_level = 0
    while (
        first_level < len(sizes) - 1
        and pca_btf.grid.num_directions * int(sizes[first_level:].sum()) * NUM_COEFFICIENTS > _MAX_TABLE_BYTES
    ):
        first_level += 1
    return np.ascontiguousarray(pca_btf.levels[first_level:] - [pca_btf.levels[first_level, 0], 0, 0], np.int32)


def _view_factors(pca_btf: LocalPcaBtf, mean: F32, integrals: F32, view: int) -> F32:
    """Coefficients for one view direction minus those of the mean: of each cluster, then of a step of each component.

    Returns:
        (K, 1 + C, 3, F)
    """
    components = pca_btf.eigen[view].astype(np.float32) * pca_btf.step[view][..., None, None]
    mean_and_components = np.concatenate([pca_btf.mean[view][:, None].astype(np.float32), components], axis=1)
    factors = mean_and_components.swapaxes(-1, -2) @ integrals
    factors[:, 0] -= mean[view]
    return factors


def _color_axes(pca_btf: LocalPcaBtf, mean: F32, integrals: F32) -> F32:
    """Principal axes of color differences between texels, by decreasing variance, from a subset of them. (3, 3)"""
    (num_views, max_texels), covariance = _AXES_SUBSET, np.zeros((3, 3))
    texels = np.arange(0, pca_btf.cluster.shape[1], max(1, pca_btf.cluster.shape[1] // max_texels))
    for view in range(0, pca_btf.grid.num_directions, max(1, pca_btf.grid.num_directions // num_views)):
        factors = _view_factors(pca_btf, mean, integrals, view)[pca_btf.cluster[view, texels]]
        weights = np.insert(pca_btf.weight[view, texels].astype(np.float32), 0, 1, axis=1)
        differences = np.einsum("xj,xjck->xck", weights, factors)
        covariance += np.einsum("xck,xdk->cd", differences, differences, dtype=np.float64)
    return np.ascontiguousarray(np.linalg.eigh(covariance)[1][:, ::-1], np.float32)


def pack(factors: Shaped[F32, "*batch 3 lanes"], axes: Shaped[F32, "3 3"]) -> Shaped[F32, "*batch 24"]:
    """Pack outgoing coefficients into 24 numbers.

    Args:
        factors: in lanes. axes: orthonormal color axes.
    """
    along = np.einsum("...ck,cm->...mk", factors, axes)
    return np.ascontiguousarray(along[..., COEFFICIENT_AXIS, COEFFICIENT_LANE], np.float32)


def filtered_factors(direction_grid: DirectionGrid) -> Shaped[F64, "directions lanes"]:
    """Integrate the basis functions against the interpolation weight of each measured direction.

    Args:
        direction_grid: the measured directions.
    Returns:
        Integrals in lanes.
    """
    z, phi = (
        (np.arange(_NUM_ELEVATIONS) + 0.5) / _NUM_ELEVATIONS,
        (np.arange(_NUM_AZIMUTHS) + 0.5) * (2 * np.pi / _NUM_AZIMUTHS),
    )
    z, phi = (grid.ravel() for grid in np.meshgrid(z, phi))
    sine = np.sqrt(1 - z**2)
    wi = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=1)
    index, weight, retained = interpolation_weights_numpy(direction_grid, wi)
    functions = pack_lanes(basis_functions(wi)[:, :NUM_FUNCTIONS]) * (retained * (2 * np.pi / len(z)))[:, None]
    out = np.zeros((direction_grid.num_directions, WIDTH))
    for tap in range(index.shape[1]):
        np.add.at(out, index[:, tap], weight[:, tap, None] * functions)
    return out


def pack_lanes(values: Shaped[F64, "*batch functions"]) -> Shaped[F64, "*batch lanes"]:
    """Reorder values per function into lanes; zero in lanes without a function."""
    return np.asarray(np.where(FUNCTIONS >= 0, values[..., FUNCTIONS], 0))
