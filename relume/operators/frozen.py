"""Freezing: a term's transport along one curve, everything dormant contracted, in the wavelet basis.

T_D4 = T_box · S, with S the orthonormal Daubechies-4 synthesis (appendix B, Ben-Artzi 2006).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.basis.daubechies import forward
from relume.brdf.term import Term
from relume.light.triangles import TriangleLights
from relume.operators.operator import Operator
from relume.operators.packed import BLOCK_SAMPLES, Packed, pack
from relume.operators.stream import TILE_SAMPLES, columns_of, stream
from relume.parallel import for_steps
from relume.project.levels import contract_levels, freed, num_levels, project_levels, runs
from relume.project.receivers import Receivers

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Frozen(Operator):
    """The linear operator from one curve to the image of one term.

    Attributes:
        transport: wavelet coefficients, samples padded with zeros to whole tiles. (tiles, 3, J, samples) float32
        importance: length of each column over all samples; what a coefficient moves in the picture. (3, J) float64,
            (L, 3, J) over those of each level
        bounds: where the samples of each level begin and end, where coefficients differ from level to level.
            (L + 1,) int64
    """

    transport: F32
    importance: NDArray[np.float64]
    bounds: NDArray[np.int64] | None = None

    is_whole = True
    is_exact = True

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.transport.nbytes

    def add(self, change: NDArray[np.float64], image: F32) -> None:
        """Add Σ_j Δc_j T_j to an image; see `Operator`."""
        stream(self.transport, columns_of(change), image, self.bounds)

    def columns_at(self, sample: int) -> NDArray[np.float64]:
        """What each coefficient gives to one sample. (3, J)"""
        tile, offset = divmod(sample, self.transport.shape[3])
        return self.transport[tile, :, :, offset].astype(np.float64)


class Rough(Frozen):
    """An operator of merged lights: how an image changes, nearly, until the exact one is there."""

    is_whole = False
    is_exact = False


def tiles_of(num_samples: int) -> tuple[int, int]:
    """Number of tiles, and samples a tile, that hold so many samples: tiles alike, none much larger than needed."""
    tiles = max(1, -(-num_samples // TILE_SAMPLES))
    samples = -(-num_samples // tiles)
    return tiles, -(-max(1, samples) // 16) * 16


def frozen_bytes(num_samples: int, num_bands: int) -> int:
    """Memory that freezing needs to keep."""
    tiles, samples = tiles_of(num_samples)
    return tiles * samples * 3 * num_bands * 4


def packed_bytes(num_samples: int, num_bands: int) -> int:
    """Memory that freezing needs to keep where it packs."""
    tiles, samples = tiles_of(num_samples)
    return tiles * 3 * num_bands * (2 * samples + 4 * -(-samples // BLOCK_SAMPLES))


def freeze(
    term: Term,
    bands: Mapping[str, NDArray[np.float64]],
    active: str,
    lights: TriangleLights,
    receivers: Receivers,
    progress: Callable[[float], None],
    cancelled: Callable[[], bool],
    *,
    is_packed: bool = False,
) -> Frozen | Packed:
    """Project all receivers along a curve.

    Args:
        bands: of all the term's curves, (3, J) each, or (L, 3, J) where one differs from level to level; the active
            one's values do not matter.
        lights, receivers: what arrives, and where.
        progress: called with the share done. cancelled: asked now and then.
        is_packed: whether the operator is packed.
    Raises:
        CancelledError: `cancelled` said so.
    """
    contractions = contract_levels(term, freed(bands, [active]), active)

    def rows(begin: int, end: int) -> F32:
        projected = project_levels(term, contractions, lights, receivers, begin, end)
        found = np.ascontiguousarray(projected.transpose(2, 0, 1))
        forward(found.reshape(-1, found.shape[2]))
        return found

    bounds = level_bounds(receivers, bands, [active])
    return lay_out(rows, contractions[0].num_columns, receivers, bounds, progress, cancelled, is_packed=is_packed)


def lay_out(
    rows: Callable[[int, int], F32],
    num_columns: int,
    receivers: Receivers,
    bounds: NDArray[np.int64] | None,
    progress: Callable[[float], None],
    cancelled: Callable[[], bool],
    *,
    is_packed: bool,
) -> Frozen | Packed:
    """Make an operator of its rows, block after block, so that nothing but itself is in memory as a whole.

    Args:
        rows: columns at samples [begin, end), called from several threads. (3, end - begin, J) float32
        num_columns: J. receivers: all samples. bounds: from `level_bounds`.
        progress: called with the share done. cancelled: asked now and then. is_packed: whether it is packed.
    Raises:
        CancelledError: `cancelled` said so.
    """
    num_samples, lock = len(receivers.normal), threading.Lock()
    tiles, samples = tiles_of(num_samples)
    blocks = -(-samples // BLOCK_SAMPLES)
    transport: NDArray[Any] = np.zeros((tiles, 3, num_columns, samples), np.int16 if is_packed else np.float32)
    scale = np.zeros((tiles, 3, num_columns, blocks if is_packed else 0), np.float32)
    squares = np.zeros((1 if bounds is None else len(bounds) - 1, 3, num_columns))

    def step(first: int, last: int) -> None:
        for tile, block in (divmod(number, blocks) for number in range(first, last)):
            offset = block * BLOCK_SAMPLES
            begin = tile * samples + offset
            end = min(begin + BLOCK_SAMPLES, (tile + 1) * samples, num_samples)
            if begin >= end:
                continue
            found = rows(begin, end)
            for level, a, b in runs(receivers.level, len(squares), begin, end):
                some = found[:, a - begin : b - begin]
                lengths = np.einsum("csj,csj->cj", some, some, dtype=np.float64)
                with lock:
                    squares[level] += lengths
            values: NDArray[Any] = found
            if is_packed:
                values, scale[tile, :, :, block] = pack(found)
            transport[tile, :, :, offset : offset + end - begin] = values.transpose(0, 2, 1)

    for_steps(step, tiles * blocks, 1, progress, cancelled, "freezing")
    importance = np.sqrt(squares if bounds is not None else squares[0])
    return Packed(transport, scale, importance, bounds) if is_packed else Frozen(transport, importance, bounds)


def level_bounds(
    receivers: Receivers, bands: Mapping[str, NDArray[np.float64]], moved: Iterable[str]
) -> NDArray[np.int64] | None:
    """Where the samples of each level begin and end, where the curves that move differ; None where they do not.

    Args:
        receivers: sorted by level. bands: of all curves. moved: names of those that are free.
    Returns:
        (L + 1,) int64
    """
    num = num_levels({name: bands[name] for name in moved})
    if num == 1 or receivers.level is None:
        return None
    return np.searchsorted(receivers.level, np.arange(num + 1)).astype(np.int64)
