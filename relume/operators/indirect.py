"""IndirectOperator: from the light that gather cells send out to the image of one term, in few coefficients.

    R(x) = c(γ) · Tʷ(x) · Lʷ                                        eq. 9, Nguyen 2010

with all curves of the term contracted, so that c · Tʷ is one row for each view sample. Blocks of neighbouring samples
share the coefficients they keep: those that move their samples most under light like the present. Only changes of light
go through rows; what they leave out is a small part of a small part of the picture.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import eye_array

from relume.basis.haar import haar, levels
from relume.brdf.term import Term
from relume.operators.indirect_kernel import (
    BLOCK_SAMPLES,
    add_shared,
    apply_rows,
    keep,
    number_cells,
    sum_by_cell,
    transform,
)
from relume.parallel import for_shares, for_steps
from relume.project.levels import contract_levels, runs
from relume.project.ray_projector import RayProjector
from relume.project.receivers import GatherRays, Receivers
from relume.project.sent import evenly
from relume.sharing import Weights

F32 = NDArray[np.float32]

NUM_KEPT = 128
_SMOOTH = 0.3  # of the light's coefficients, how much may come from anywhere on their level
_BLOCKS_A_STEP = 8


@dataclass(frozen=True)
class IndirectOperator:
    """The operator from the light of gather cells to the image of one term.

    Attributes:
        kept: Haar coefficients of each block of samples. (blocks, K) int32
        scale: what a step of their weights is worth. (blocks, K) float32
        weights: (blocks, K, channels, `BLOCK_SAMPLES`) int16; one channel where all are alike, else three
        num_samples: of the image, the last block's padding left out.
        sharing: weights of the samples for each other.
    """

    kept: NDArray[np.int32]
    scale: F32
    weights: NDArray[np.int16]
    num_samples: int
    sharing: Weights

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.kept.nbytes + self.scale.nbytes + self.weights.nbytes

    def add(self, light: F32, image: F32) -> None:
        """Add what light of cells brings, in place.

        Args:
            light: its Haar coefficients. (padded cells, 3) float32. image: (tiles, 3, samples) float32
        Cost: reads all weights once; bound by the memory's bandwidth.
        """
        args = (self.kept, self.scale, self.weights, light)
        alone = np.empty((len(self.kept) * BLOCK_SAMPLES, 4), np.float32)
        for_shares(lambda start, stop: apply_rows(*args, start, stop, alone), len(self.kept))
        matrix, times = self.sharing
        for _ in range(times - 1):
            alone[: self.num_samples] = matrix @ alone[: self.num_samples]
        shares = (matrix.indptr, matrix.indices, matrix.data)
        for_shares(lambda start, stop: add_shared(*shares, alone, start, stop, image), self.num_samples)


def rows_bytes(num_samples: int, num_channels: int) -> int:
    """Memory that rows need."""
    blocks = -(-num_samples // BLOCK_SAMPLES)
    return blocks * NUM_KEPT * (2 * num_channels * BLOCK_SAMPLES + 8)


def num_channels(term: Term, bands: Mapping[str, NDArray[np.float64]]) -> int:
    """Channels that rows have: one where a term weighs all of them alike, else three."""
    upright = np.array([0, 0, 1], np.float32).reshape(3, 1)
    alike = all(
        np.all(c.num_rows == 1) and np.all(c.constant == c.constant[0]) for c in contract_levels(term, bands, None)
    )
    return 1 if alike and len(term.quotients(*upright, *upright)) == 1 else 3


def expected_light(radiance: F32) -> F32:
    """How large the Haar coefficients of light are that is like some light of cells. (padded cells,) float32

    Args:
        radiance: of cells. (C, 3)
    """
    magnitude = np.sqrt(np.square(haar(radiance)).sum(axis=1))
    level = levels(len(magnitude))
    squares = np.bincount(level, np.square(magnitude)) / np.bincount(level)
    expected = magnitude + _SMOOTH * np.sqrt(squares)[level]
    return np.asarray(expected if expected.any() else 0.5**level, np.float32)


def freeze_rows(
    term: Term,
    bands: Mapping[str, NDArray[np.float64]],
    points: Receivers,
    rays: GatherRays,
    expected: F32,
    progress: Callable[[float], None],
    cancelled: Callable[[], bool],
) -> IndirectOperator:
    """Contract all curves of a term along the rays of points.

    Args:
        bands: of each curve that depends on wi. (3, J) each, or (L, 3, J) where it differs from level to level
        points: what arrives at them does not matter. rays: theirs, whatever is sent.
        expected: from `expected_light`.
        progress: called with the share done. cancelled: asked now and then.
    Raises:
        CancelledError: `cancelled` said so.
    """
    lit_by_ones = replace(points, rays=(replace(rays, sent=evenly(np.ones_like(rays.sent.even))),))
    contractions, num_samples = contract_levels(term, bands, None), len(points.normal)
    blocks = -(-num_samples // BLOCK_SAMPLES)
    rows = IndirectOperator(
        np.empty((blocks, NUM_KEPT), np.int32),
        np.empty((blocks, NUM_KEPT), np.float32),
        np.empty((blocks, NUM_KEPT, num_channels(term, bands), BLOCK_SAMPLES), np.int16),
        num_samples,
        _alone(num_samples) if rays.sharing is None else rays.sharing.of(term),
    )

    def step(first: int, last: int) -> None:
        projectors = [RayProjector(term, contraction, lit_by_ones, BLOCK_SAMPLES) for contraction in contractions]
        maker = _RowMaker(projectors, points.level, rays, expected)
        for block in range(first, last):
            maker.write(rows, block)

    for_steps(step, blocks, _BLOCKS_A_STEP, progress, cancelled, "freezing")
    return rows


def _alone(num_samples: int) -> Weights:
    return Weights(eye_array(num_samples, dtype=np.float32, format="csr"), 1)


class _RowMaker:
    """Makes the rows of one block after another; holds the scratch memory of one thread."""

    def __init__(
        self,
        projectors: Sequence[RayProjector],
        level: NDArray[np.uint8] | None,
        rays: GatherRays,
        expected: F32,
    ) -> None:
        self._projectors, self._level = projectors, level
        self._links, self._expected = rays.links, expected
        self._place = np.empty(len(expected), np.int32)
        most = len(expected) + 1
        self._index = np.empty(most, np.int32)
        self._details = np.empty(most * 3 * BLOCK_SAMPLES, np.float32)  # the system gives what is written to

    def write(self, rows: IndirectOperator, block: int) -> None:
        """Make one block."""
        start, channels = block * BLOCK_SAMPLES, rows.weights.shape[2]
        stop = min(start + BLOCK_SAMPLES, rows.num_samples)
        seen = number_cells(self._links, start, stop, self._place)
        if len(seen) == 0:
            rows.kept[block], rows.scale[block], rows.weights[block] = 0, 0, 0
            return
        of_levels = runs(self._level, len(self._projectors), start, stop)
        weights = [self._projectors[level].weigh(first, last) for level, first, last in of_levels]
        weight = np.concatenate(weights, axis=1)[:channels]
        sums = np.zeros((len(seen), channels, BLOCK_SAMPLES), np.float32)
        sum_by_cell(self._links, start, stop, self._place, weight, sums)
        width = channels * BLOCK_SAMPLES
        details = self._details[: len(self._index) * width].reshape(-1, width)
        num_levels = len(self._expected).bit_length() - 1
        num = transform(seen, sums.reshape(-1, width), num_levels, self._index, details)
        keep(
            self._index[:num], details[:num], self._expected,
            rows.kept[block], rows.scale[block], rows.weights[block].reshape(NUM_KEPT, width),
        )  # fmt: skip
