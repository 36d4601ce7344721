"""Outgoing radiance of patches: isotropic, plus a directional part for patches with highlights.

    L(c, ωo) = L̄_c + Σ_j L_j h_j(ωo)

h are the functions of the Zernike basis (`relume.math.zernike`) about the patch normal. For lookups by gather rays the
sum is tabulated as averages over direction bins: a grid over (x, y) / (1 + z), equally fine at horizon and normal. Rays
spread over the bins, so that their sum hardly depends on the tabulation.

A low-degree expansion of a small bright light rings, with negative values. Wide gathering averages the rings away; a
narrow lobe does not. A second, smoothed table serves narrow lobes: L_j times a factor per degree, which reduces the
rings (docs/indirect-light.md#bounces).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.math.direction_grid import SIDE, bin_solid_angles, offsets_in_bin
from relume.math.zernike import DEGREES, OUTGOING_DEGREE, WINDOW_DECAY, basis_functions, num_functions
from relume.patches.patch_kdtree import NO_PATCH

F32 = NDArray[np.float32]

NUM_OUTGOING = num_functions(OUTGOING_DEGREE)
"""J, basis functions of outgoing light."""

_NARROWEST = 1 / (2 * 4.9**2)  # of highlight and window together: a metal of roughness 0.3
_STEPS = 32_767  # of 16-bit radiance
_NO_EXTRA_BINS = np.empty(0, np.intp), np.empty((0, 3, SIDE * SIDE), np.float32)


class OutgoingLight(NamedTuple):
    """Outgoing radiance of patches.

    Attributes:
        isotropic: the isotropic part; black in row `NO_PATCH`.
        lobe: row of each patch in the other arrays; −1: isotropic only.
        frame: tangents and bitangents. scale: radiance of one step of the table.
        table: table of each bin, x outermost. smooth: the same, with fewer rings.
    """

    isotropic: Shaped[F32, "patches 3"]
    lobe: Shaped[NDArray[np.int32], " patches"]
    frame: Shaped[F32, "G 2 3"]
    scale: Shaped[F32, "G 3"]
    table: Shaped[NDArray[np.int16], "G bins 3"]
    smooth: Shaped[NDArray[np.int16], "G bins 3"]


def isotropic(radiance: Shaped[F32, "patches 3"]) -> OutgoingLight:
    """Return isotropic outgoing light. radiance: black in row `NO_PATCH`."""
    return radiance_from_patch(
        radiance, np.empty(0, np.intp), np.empty((0, 2, 3), np.float32), np.empty((0, 3, NUM_OUTGOING), np.float32)
    )


@lru_cache(maxsize=1)
def no_light() -> OutgoingLight:
    """Return the light of black patches, for rays whose light follows."""
    return isotropic(np.zeros((NO_PATCH + 1, 3), np.float32))


def radiance_from_patch(
    isotropic_radiance: Shaped[F32, "patches 3"],
    rows: Shaped[NDArray[np.intp], " G"],
    frame: Shaped[F32, "G 2 3"],
    coefficients: Shaped[F32, "G 3 J"],
    decay: Shaped[F32, " G"] | None = None,
    extra_bins: tuple[NDArray[np.intp], F32] | None = None,
    *,
    is_positive: bool = False,
) -> OutgoingLight:
    """Tabulate the outgoing radiance of patches.

    Args:
        isotropic_radiance: as in `OutgoingLight`. rows: patches with a directional part.
        frame: their tangents and bitangents. coefficients: their L_j.
        decay: decay of the smoothed table, see `decay_of`; None if only patches look it up, which gather widely:
            `smooth` is then `table`.
        extra_bins: additional binned radiance of some of the G: ascending indices, (F,), and radiance, (F, 3, SIDE²).
        is_positive: the light is no difference: where rings take it below zero it is black, and less elsewhere, so that
            the flux remains.
    """
    lobe = np.full(NO_PATCH + 1, -1, np.int32)
    lobe[rows] = np.arange(len(rows))
    degrees = DEGREES[:NUM_OUTGOING] * (DEGREES[:NUM_OUTGOING] + 2)
    variants = [coefficients]
    if decay is not None:
        variants.append((coefficients * np.exp(-np.outer(decay, degrees))[:, None]).astype(np.float32))
    extra_rows, extra_radiance = extra_bins or _NO_EXTRA_BINS
    extra_row = np.full(len(rows), -1, np.int32)
    extra_row[extra_rows] = np.arange(len(extra_rows))
    scale = np.empty((len(rows), 3), np.float32)
    tables = np.empty((len(variants), len(rows), SIDE * SIDE, 3), np.int16)
    basis = np.stack(variants).astype(np.float32), bin_means()
    args = *basis, isotropic_radiance[rows], extra_row, extra_radiance, _bin_areas(), is_positive
    parallel_for_chunks(lambda start, stop: _tabulate(*args, start, stop, scale, tables), len(rows))
    return OutgoingLight(isotropic_radiance, lobe, np.ascontiguousarray(frame), scale, tables[0], tables[-1])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _tabulate(  # type: ignore[no-untyped-def]
    coefficients, means, even, extra_row, extra, areas, is_positive, start, stop, scale, tables
):
    """Tabulate the patches [start, stop).

    Args:
        coefficients: L_j for each table. (tables, G, 3, J). means: `bin_means`. even: isotropic radiance. (G, 3)
        extra_row: row of each patch in `extra`, −1 for none. (G,). extra: additional radiance. (F, 3, bins)
        areas: `bin_solid_angles`, float32. is_positive: see `radiance_from_patch`.
        scale, tables: written; see `OutgoingLight`. (G, 3), (tables, G, bins, 3)
    """
    values = np.empty((coefficients.shape[0], means.shape[1]), np.float32)
    for g in range(start, stop):
        for channel in range(3):
            largest = np.float32(1e-30)
            for t in range(values.shape[0]):
                value = values[t]
                value[:] = 0
                for j in range(means.shape[0]):
                    coefficient = coefficients[t, g, channel, j]
                    for b in range(means.shape[1]):
                        value[b] += coefficient * means[j, b]
                if extra_row[g] >= 0:
                    value += extra[extra_row[g], channel]
                if is_positive:
                    _clip_negative(value, even[g, channel], areas)
                for b in range(means.shape[1]):
                    largest = max(largest, abs(value[b]))
            scale[g, channel] = largest / np.float32(_STEPS)
            steps = np.float32(_STEPS) / largest
            for t in range(values.shape[0]):
                for b in range(means.shape[1]):
                    tables[t, g, b, channel] = np.int16(np.rint(steps * values[t, b]))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True)
def _clip_negative(value, even, areas):  # type: ignore[no-untyped-def]
    """Clip the radiance of a patch at zero, and scale the rest to its flux ∫ L cos θ dω; black without any.

    Args:
        value: its directional part, overwritten. (bins,). even: its isotropic part. areas: of the bins. (bins,)
    """
    flux, clipped_flux = np.float32(0), np.float32(1e-30)
    for b in range(value.shape[0]):
        radiance = value[b] + even
        flux += areas[b] * radiance
        clipped_flux += areas[b] * max(radiance, np.float32(0))
    gain = max(flux, np.float32(0)) / clipped_flux
    for b in range(value.shape[0]):
        value[b] = gain * max(value[b] + even, np.float32(0)) - even


def decay_of(roughening: Shaped[F32, " G"]) -> Shaped[F32, " G"]:
    """Decay f per patch of the smoothed table; degree n is multiplied by e^(−n (n + 2) f).

    Sharp highlights ring most, and patches do not store their sharpness: all are smoothed to that of a rough metal.

    Args:
        roughening: decay f by the patches' own highlights.
    """
    return np.asarray(np.maximum(WINDOW_DECAY, _NARROWEST - roughening), np.float32)


@lru_cache(maxsize=1)
def bin_means() -> Shaped[F32, "J bins"]:
    """Cosine-weighted average of each basis function over each direction bin."""
    wi, weight = offsets_in_bin()  # bins outside the disk take the values of its edge
    functions = basis_functions(wi)[..., :NUM_OUTGOING]
    means = np.einsum("xaybj,xayb->xyj", functions, weight) / np.einsum("xayb->xy", weight)[..., None]
    return np.ascontiguousarray(means.reshape(SIDE * SIDE, NUM_OUTGOING).T, np.float32)


@lru_cache(maxsize=1)
def _bin_areas() -> Shaped[F32, " bins"]:
    return bin_solid_angles().astype(np.float32)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def bin_of(frame, row, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Return the bin of a direction.

    Args:
        frame: frame of all rows. (G, 2, 3) float32. row: row of the patch.
        dx, dy, dz: unit, away from the patch, world space.
    """
    x = frame[row, 0, 0] * dx + frame[row, 0, 1] * dy + frame[row, 0, 2] * dz
    y = frame[row, 1, 0] * dx + frame[row, 1, 1] * dy + frame[row, 1, 2] * dz
    half = np.float32(SIDE / 2)
    scale = half / (np.float32(1) + np.float32(math.sqrt(max(np.float32(0), np.float32(1) - x * x - y * y))))
    across, along = np.int32(half + scale * x), np.int32(half + scale * y)
    return min(max(across, 0), SIDE - 1) * SIDE + min(max(along, 0), SIDE - 1)  # type: ignore[operator]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def incident_along(outgoing, gather_hits, bins, out):  # type: ignore[no-untyped-def]
    """Look up the radiance that arrives along the rays of a point.

    Args:
        outgoing: outgoing light of all patches, an `OutgoingLight`.
        gather_hits: patches that the rays hit. (rays,) uint16
        bins: direction bin at the patch. (rays,) uint8
        out: radiance, written. (3, rays) float32
    """
    for ray in range(gather_hits.shape[0]):
        for channel in range(3):
            out[channel, ray] = outgoing.isotropic[gather_hits[ray], channel]
    if outgoing.table.shape[0] == 0:
        return
    for ray in range(gather_hits.shape[0]):
        row = outgoing.lobe[gather_hits[ray]]
        if row >= 0:
            for channel in range(3):
                out[channel, ray] += outgoing.scale[row, channel] * outgoing.table[row, bins[ray], channel]
