"""Precomputed linear operators: a term's transport along one free curve, all others fixed, in the wavelet basis.

T_D4 = T_box · S, with S the orthonormal Daubechies-4 synthesis (appendix B, Ben-Artzi 2006).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.core.thread_pools import parallel_for_cancellable
from relume.lights.spherical_triangles import TriangleLights
from relume.math.daubechies import forward
from relume.operators.operator import Operator
from relume.operators.quantized import BLOCK_SAMPLES, QuantizedOperator, quantize
from relume.operators.update_kernel import TILE_SAMPLES, changed_columns, stream
from relume.transport.roughness_ranges import (
    contract_levels,
    num_levels,
    project_levels,
    split_by_level,
    without_free_curves,
)
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class LinearOperator(Operator):
    """Wavelet linear operator from one curve to the image of one term.

    Attributes:
        transport: wavelet coefficients, samples padded with zeros to whole tiles.
        importance: norm of each column over all samples; (3, J), or (L, 3, J) over those of each level.
        bounds: ranges of the levels' samples, if coefficients depend on the level.
    """

    transport: Shaped[F32, "tiles 3 J samples"]
    importance: Shaped[NDArray[np.float64], "*levels 3 J"]
    bounds: Shaped[NDArray[np.int64], " ends"] | None = None

    is_whole = True
    is_exact = True

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        return self.transport.nbytes

    def add(self, change: Shaped[NDArray[np.float64], "*levels 3 J"], image: Shaped[F32, "tiles 3 samples"]) -> None:
        """Add Σ_j Δc_j T_j to an image; see `Operator`."""
        stream(self.transport, changed_columns(change), image, self.bounds)

    def columns_at(self, sample: int) -> Shaped[NDArray[np.float64], "3 J"]:
        """Return the column values at one sample."""
        tile, offset = divmod(sample, self.transport.shape[3])
        return self.transport[tile, :, :, offset].astype(np.float64)


class MergedLightOperator(LinearOperator):
    """Merged-light operator: approximates changes of an image until the exact operator is computed."""

    is_whole = False
    is_exact = False


def tile_layout(num_samples: int) -> tuple[int, int]:
    """Return the number of equal tiles for a number of samples, and their size, with little padding."""
    tiles = max(1, -(-num_samples // TILE_SAMPLES))
    samples = -(-num_samples // tiles)
    return tiles, -(-max(1, samples) // 16) * 16


def operator_bytes(num_samples: int, num_bands: int) -> int:
    """Return the memory of an operator."""
    tiles, samples = tile_layout(num_samples)
    return tiles * samples * 3 * num_bands * 4


def quantized_bytes(num_samples: int, num_bands: int) -> int:
    """Return the memory of a quantized operator."""
    tiles, samples = tile_layout(num_samples)
    return tiles * 3 * num_bands * (2 * samples + 4 * -(-samples // BLOCK_SAMPLES))


def precompute(
    term: Term,
    bands: Mapping[str, NDArray[np.float64]],
    active: str,
    lights: TriangleLights,
    receivers: ShadingPoints,
    progress: Callable[[float], None],
    is_canceled: Callable[[], bool],
    *,
    is_quantized: bool = False,
) -> LinearOperator | QuantizedOperator:
    """Precompute the operator of one free curve at all receivers.

    Args:
        bands: bands of all the term's curves, (3, J) each, or (L, 3, J) if one depends on the level; values of the
            active one do not matter.
        lights, receivers: incident light, and its receivers.
        progress: called with the completed fraction. is_canceled: polled.
        is_quantized: whether the operator is quantized.
    Raises:
        CancelledError: `is_canceled` returned True.
    """
    contractions = contract_levels(term, without_free_curves(bands, [active]), active)

    def rows(start: int, stop: int) -> F32:
        projected = project_levels(term, contractions, lights, receivers, start, stop)
        coefficients = np.ascontiguousarray(projected.transpose(2, 0, 1))
        forward(coefficients.reshape(-1, coefficients.shape[2]))
        return coefficients

    bounds = level_bounds(receivers, bands, [active])
    return pack_columns(
        rows, contractions[0].num_columns, receivers, bounds, progress, is_canceled, is_quantized=is_quantized
    )


def pack_columns(
    rows: Callable[[int, int], F32],
    num_columns: int,
    receivers: ShadingPoints,
    bounds: Shaped[NDArray[np.int64], " ends"] | None,
    progress: Callable[[float], None],
    is_canceled: Callable[[], bool],
    *,
    is_quantized: bool,
) -> LinearOperator | QuantizedOperator:
    """Build an operator from its rows, block by block, so that no second copy is in memory.

    Args:
        rows: columns at samples [begin, end), called from several threads. (3, end - begin, J) float32
        num_columns: J. receivers: all samples. bounds: from `level_bounds`.
        progress: called with the completed fraction. is_canceled: polled. is_quantized: whether it is quantized.
    Raises:
        CancelledError: `is_canceled` returned True.
    """
    num_samples, lock = len(receivers.normal), threading.Lock()
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
    return (
        QuantizedOperator(transport, scale, importance, bounds)
        if is_quantized
        else LinearOperator(transport, importance, bounds)
    )


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
