"""Light that gather cells send out: of most the same in every direction, of those with highlights not.

    L(c, ωo) = L̄_c + Σ_j L_j h_j(ωo)

with the functions h of the in-basis (`relume.math.zernike`) about the cell's own normal. Looked up once for every
gather ray, the sum is tabulated: by the means of each function over the squares of a grid, on which a direction has the
place (x, y) / (1 + z), so that the horizon is as fine as the normal. Rays spread over the squares, and what they bring
together hardly knows the difference.

What few functions make of a small bright light has rings about it, in part below nothing. Who gathers widely sees none
of them; a narrow lobe sees one alone. For those there is a second table, of L_j times a factor of its degree, which
takes a part of them away (docs/indirect-light.md#bounces).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.core.thread_pools import for_ranges
from relume.math.direction_grid import SIDE, offsets_in_bin
from relume.math.zernike import DEGREES, OUTGOING_DEGREE, WINDOW_DECAY, num_functions, project
from relume.patches.patch_kdtree import NO_PATCH

F32 = NDArray[np.float32]

NUM_OUTGOING = num_functions(OUTGOING_DEGREE)
"""J, functions by which cells send."""

_NARROWEST = 1 / (2 * 4.9**2)  # of a highlight and the window together: a metal's of roughness 0.3
_STEPS = 32_767  # of 16-bit radiance
_ROWS_PER_RANGE = 256  # their values stay in the cache


class OutgoingLight(NamedTuple):
    """Radiance that leaves cells.

    Attributes:
        isotropic: the part that is the same everywhere; black in row `NO_PATCH`. (NO_CELL + 1, 3) float32
        lobe: which row of the others a cell has; −1: it sends nothing but the even part. (NO_CELL + 1,) int32
        frame: tangents and bitangents. (G, 2, 3) float32
        scale: what a step of the table is worth. (G, 3) float32
        table: of each square, x outermost. (G, SIDE², 3) int16
        smooth: the same, with fewer rings. (G, SIDE², 3) int16
    """

    isotropic: F32
    lobe: NDArray[np.int32]
    frame: F32
    scale: F32
    table: NDArray[np.int16]
    smooth: NDArray[np.int16]


def isotropic(radiance: F32) -> OutgoingLight:
    """Send the same in every direction. radiance: black in row `NO_PATCH`. (NO_CELL + 1, 3) float32"""
    return radiance_from_patch(
        radiance, np.empty(0, np.intp), np.empty((0, 2, 3), np.float32), np.empty((0, 3, NUM_OUTGOING), np.float32)
    )


def radiance_from_patch(
    isotropic_radiance: F32,
    rows: NDArray[np.intp],
    frame: F32,
    coefficients: F32,
    decay: F32 | None = None,
    extra_bins: tuple[NDArray[np.intp], F32] | None = None,
) -> OutgoingLight:
    """Put together what cells send.

    Args:
        isotropic_radiance: as in `OutgoingLight`. rows: the cells that send more one way than another. (G,)
        frame: their tangents and bitangents. (G, 2, 3) float32. coefficients: L_j of each. (G, 3, J) float32
        decay: how fast what narrow lobes see of each falls with the degree, see `decay_of`. (G,) float32; None where
            only cells look it up, which see widely: `smooth` is `table` then.
        extra_bins: what some of them send besides by squares: which of the G, rising, (F,), and radiance, (F, 3,
            SIDE²).
    """
    lobe = np.full(NO_PATCH + 1, -1, np.int32)
    lobe[rows] = np.arange(len(rows))
    scale = np.empty((len(rows), 3), np.float32)
    means, degrees = bin_means(), DEGREES[:NUM_OUTGOING] * (DEGREES[:NUM_OUTGOING] + 2)
    tables = np.empty((1 if decay is None else 2, len(rows), SIDE * SIDE, 3), np.int16)

    def fill(start: int, stop: int) -> None:
        block = coefficients[start:stop]
        variants = [block] if decay is None else [block, block * np.exp(-np.outer(decay[start:stop], degrees))[:, None]]
        values = np.stack(variants).astype(np.float32) @ means  # (tables, cells, 3, squares)
        if extra_bins is not None:
            selection = slice(*np.searchsorted(extra_bins[0], [start, stop]))
            values[:, extra_bins[0][selection] - start] += extra_bins[1][selection]
        largest = np.maximum(values.max(axis=(0, 3)), -values.min(axis=(0, 3)))
        scale[start:stop] = np.maximum(largest, np.float32(1e-30)) / np.float32(_STEPS)
        values /= scale[start:stop, :, None]
        np.rint(values, out=values)
        tables[:, start:stop] = values.transpose(0, 1, 3, 2)

    for_ranges(fill, len(rows), _ROWS_PER_RANGE)
    return OutgoingLight(isotropic_radiance, lobe, frame, scale, tables[0], tables[-1])


def decay_of(roughening: F32) -> F32:
    """How fast what narrow lobes see of cells is to fall with the degree n, as e^(−n (n + 2) f). (G,) float32

    Sharp highlights ring most, and no cell tells how sharp they are: they are seen as wide as those of rough metal.

    Args:
        roughening: f by which the cells' highlights let light fall themselves. (G,)
    """
    return np.asarray(np.maximum(WINDOW_DECAY, _NARROWEST - roughening), np.float32)


@lru_cache(maxsize=1)
def bin_means() -> F32:
    """The mean of each function over each square, by the cosine. (J, SIDE²) float32"""
    wi, weight = offsets_in_bin()  # a square off the disc is as the rim beside it
    functions = project(wi)[..., :NUM_OUTGOING]
    means = np.einsum("xaybj,xayb->xyj", functions, weight) / np.einsum("xayb->xy", weight)[..., None]
    return np.ascontiguousarray(means.reshape(SIDE * SIDE, NUM_OUTGOING).T, np.float32)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def bin_of(frame, row, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Find the square of a direction.

    Args:
        frame: of all rows. (G, 2, 3) float32. row: of the cell.
        dx, dy, dz: unit, away from the cell, world space.
    """
    x = frame[row, 0, 0] * dx + frame[row, 0, 1] * dy + frame[row, 0, 2] * dz
    y = frame[row, 1, 0] * dx + frame[row, 1, 1] * dy + frame[row, 1, 2] * dz
    half = np.float32(SIDE / 2)
    scale = half / (np.float32(1) + np.float32(math.sqrt(max(np.float32(0), np.float32(1) - x * x - y * y))))
    across, along = np.int32(half + scale * x), np.int32(half + scale * y)
    return min(max(across, 0), SIDE - 1) * SIDE + min(max(along, 0), SIDE - 1)  # type: ignore[operator]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def incident_along(outgoing, gather_hits, bins, out):  # type: ignore[no-untyped-def]
    """Look up what cells send along the rays of a point.

    Args:
        outgoing: by all cells, a `OutgoingLight`. gather_hits: cells that the rays hit. (rays,) uint16
        bins: in which light leaves them. (rays,) uint8
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
