"""Precomputed linear operators: a term's transport along free coefficients, all other factors fixed."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.thread_pools import parallel_for_cancellable
from relume.operators.update_kernel import (
    BLOCK_SAMPLES,
    TILE_SAMPLES,
    changed_columns,
    interpolate,
    stream,
    stream_quantized,
)
from relume.transport.roughness_ranges import num_levels, split_by_level
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NUM_NEIGHBORS = 3  # selected samples that a sample is interpolated from
_MAX_CODE = 32_767


class Compression(NamedTuple):
    """Compression of an operator; the default is none.

    Attributes:
        step: one sample per block of step × step pixels; 1: all.
        bits: size of a value: 32, or 16 for integers with a scale per column and block of samples.
        has_merged_lights: computed from merged lights.
    """

    step: int = 1
    bits: int = 32
    has_merged_lights: bool = False


class Interpolation(NamedTuple):
    """Interpolation of all samples from selected ones.

    Attributes:
        num_selected: number of selected samples. neighbors: those around each sample.
        weight: weights of these; rows sum to one.
    """

    num_selected: int
    neighbors: Shaped[NDArray[np.int32], "n k"]
    weight: Shaped[F32, "n k"]


@dataclass(frozen=True)
class LinearOperator:
    """Linear operator from the coefficients of an edit to the image of one term: R = T c; compressed, R' = R + W T Δc.

    16 bits take half the memory: T_ij ≈ s_bj n_ij, with s_bj the largest |T_ij| of block b over 32,767. Images of all
    columns are within 10⁻⁴ of those in float32. With selected samples, W interpolates their changes to all others: the
    image keeps its shadows, edges and normal-mapped detail (docs/direct-light.md#algorithm).

    Attributes:
        transport: columns, samples padded with zeros to whole tiles; float32, or integers of 16 bits.
        importance: norm of each column over all samples; (3, J), or (L, 3, J) over those of each level.
        bounds: ranges of the levels' samples, if coefficients depend on the level.
        scale: factors of 16-bit values; None for float32.
        interpolation: interpolation from the columns' samples; None: they are all samples.
        has_merged_lights: computed from merged lights.
    """

    transport: Shaped[NDArray[Any], "tiles 3 J samples"]
    importance: Shaped[F64, "*levels 3 J"]
    bounds: Shaped[NDArray[np.int64], " ends"] | None = None
    scale: Shaped[F32, "tiles 3 J blocks"] | None = None
    interpolation: Interpolation | None = None
    has_merged_lights: bool = False

    @property
    def is_whole(self) -> bool:
        """True if its sums are images; otherwise they are changes of an image."""
        return self.interpolation is None and not self.has_merged_lights

    @property
    def is_exact(self) -> bool:
        """True if its sums equal a full evaluation up to rounding."""
        return self.is_whole and self.scale is None

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        scale_bytes = 0 if self.scale is None else self.scale.nbytes
        neighbor_arrays = () if self.interpolation is None else self.interpolation[1:]
        return self.transport.nbytes + scale_bytes + sum(array.nbytes for array in neighbor_arrays)

    def add(self, change: Shaped[F64, "*levels 3 J"], image: Shaped[F32, "tiles 3 samples"]) -> None:
        """Add Σ_j Δc_j T_j to an image, for the changes Δc of all columns."""
        if self.interpolation is None:
            self._add_columns(change, image)
            return
        tiles, _, _, samples = self.transport.shape
        selected_change = np.zeros((tiles, 3, samples), np.float32)
        self._add_columns(change, selected_change)
        rows = np.ascontiguousarray(selected_change.transpose(0, 2, 1).reshape(-1, 3))
        interpolate(rows, self.interpolation.neighbors, self.interpolation.weight, image)

    def _add_columns(self, change: F64, image: F32) -> None:
        columns = changed_columns(change)
        if self.scale is None:
            stream(self.transport, columns, image, self.bounds)
        else:
            stream_quantized(self.transport, self.scale, columns, image, self.bounds)

    def write_image(self, coefficients: Shaped[F64, "*levels 3 J"], image: Shaped[F32, "tiles 3 samples"]) -> None:
        """Overwrite an image with Σ_j c_j T_j, for the coefficients c of all columns."""
        image[:] = 0
        self.add(coefficients, image)

    def columns_at(self, sample: int) -> Shaped[F64, "3 J"]:
        """Return the column values at one sample."""
        if self.interpolation is None:
            return self._stored_columns(sample)
        _, neighbors, weight = self.interpolation
        columns = [self._stored_columns(int(row)) for row in neighbors[sample]]
        return np.asarray(np.tensordot(weight[sample].astype(np.float64), columns, 1))

    def _stored_columns(self, sample: int) -> F64:
        tile, offset = divmod(sample, self.transport.shape[3])
        columns = self.transport[tile, :, :, offset].astype(np.float64)
        return columns if self.scale is None else columns * self.scale[tile, :, :, offset // BLOCK_SAMPLES]

    def interpolated(self, interpolation: Interpolation) -> LinearOperator:
        """Return the operator of all samples from this one of selected samples."""
        num_represented = len(interpolation.neighbors) / max(1, interpolation.num_selected)
        return replace(self, importance=self.importance * np.sqrt(num_represented), interpolation=interpolation)


def tile_layout(num_samples: int) -> tuple[int, int]:
    """Return the number of equal tiles for a number of samples, and their size, with little padding."""
    tiles = max(1, -(-num_samples // TILE_SAMPLES))
    samples = -(-num_samples // tiles)
    return tiles, -(-max(1, samples) // 16) * 16


def operator_bytes(num_samples: int, num_bands: int, bits: int = 32, num_selected: int | None = None) -> int:
    """Return the memory of an operator.

    Args:
        num_samples: number of samples of the term. num_bands: columns per channel. bits: see `Compression`.
        num_selected: samples of the columns; None: all.
    """
    tiles, samples = tile_layout(num_samples if num_selected is None else num_selected)
    scale_bytes = 4 * -(-samples // BLOCK_SAMPLES) if bits < 32 else 0
    neighbor_bytes = 0 if num_selected is None else num_samples * 8 * NUM_NEIGHBORS
    return tiles * 3 * num_bands * (bits // 8 * samples + scale_bytes) + neighbor_bytes


def pack_columns(
    rows: Callable[[int, int], F32],
    num_columns: int,
    receivers: ShadingPoints,
    bounds: Shaped[NDArray[np.int64], " ends"] | None,
    progress: Callable[[float], None],
    is_canceled: Callable[[], bool],
    bits: int,
) -> LinearOperator:
    """Build an operator from its rows, block by block, so that no second copy is in memory.

    Args:
        rows: columns at samples [begin, end), called from several threads. (3, end - begin, J) float32
        num_columns: J. receivers: all samples. bounds: from `level_bounds`.
        progress: called with the completed fraction. is_canceled: polled. bits: see `Compression`.
    Raises:
        CancelledError: `is_canceled` returned True.
    """
    num_samples, is_quantized, lock = len(receivers.normal), bits < 32, threading.Lock()
    tiles, samples = tile_layout(num_samples)
    num_blocks = -(-samples // BLOCK_SAMPLES)
    transport: NDArray[Any] = np.zeros((tiles, 3, num_columns, samples), np.int16 if is_quantized else np.float32)
    scale = np.zeros((tiles, 3, num_columns, num_blocks if is_quantized else 0), np.float32)
    squared_norms = np.zeros((1 if bounds is None else len(bounds) - 1, 3, num_columns))

    def step(first: int, last: int) -> None:
        for tile, block in (divmod(number, num_blocks) for number in range(first, last)):
            offset = block * BLOCK_SAMPLES
            start = tile * samples + offset
            stop = min(start + BLOCK_SAMPLES, (tile + 1) * samples, num_samples)
            if start >= stop:
                continue
            columns = rows(start, stop)
            for level, a, b in split_by_level(receivers.level, len(squared_norms), start, stop):
                level_columns = columns[:, a - start : b - start]
                level_norms = np.einsum("csj,csj->cj", level_columns, level_columns, dtype=np.float64)
                with lock:
                    squared_norms[level] += level_norms
            values: NDArray[Any] = columns
            if is_quantized:
                values, scale[tile, :, :, block] = quantize(columns)
            transport[tile, :, :, offset : offset + stop - start] = values.transpose(0, 2, 1)

    parallel_for_cancellable(step, tiles * num_blocks, 1, progress, is_canceled, "precomputing")
    importance = np.sqrt(squared_norms if bounds is not None else squared_norms[0])
    return LinearOperator(transport, importance, bounds, scale if is_quantized else None)


def quantize(
    rows: Shaped[F32, "channels samples J"],
) -> tuple[Shaped[NDArray[np.int16], "channels samples J"], Shaped[F32, "channels J"]]:
    """Quantize the columns of one block of samples; returns integers and their scales."""
    scale = np.abs(rows).max(axis=1) / np.float32(_MAX_CODE)
    inverse_scale = np.divide(1, scale, out=np.zeros_like(scale), where=scale > np.finfo(np.float32).tiny)
    return np.rint(rows * inverse_scale[:, None]).clip(-_MAX_CODE, _MAX_CODE).astype(np.int16), scale


def level_bounds(
    receivers: ShadingPoints, bands: Mapping[str, NDArray[np.float64]], free_curves: Iterable[str]
) -> Shaped[NDArray[np.int64], " ends"] | None:
    """Return the L + 1 bounds of the levels' samples, if free curves depend on the level; else None.

    Args:
        receivers: sorted by level. bands: bands of all curves. free_curves: names of the free curves.
    """
    num_of_levels = num_levels({name: bands[name] for name in free_curves})
    if num_of_levels == 1 or receivers.level is None:
        return None
    return np.searchsorted(receivers.level, np.arange(num_of_levels + 1)).astype(np.int64)
