"""Wavelet operator of indirect light: from the radiance of patches to the image of one term, in few Haar coefficients.

    R(x) = c(γ) · Tʷ(x) · Lʷ                                        eq. 9, Nguyen 2010

All curves of the term are contracted, so that c · Tʷ is one row per view sample. Blocks of neighboring samples share
their selected coefficients: those that change the samples most under light like the present. Only changes of light
use these transport rows, so that the truncation affects a small part of an image.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array

from relume.brdf.term import Term
from relume.core.thread_pools import parallel_for_cancellable, parallel_for_chunks
from relume.math.haar import coefficient_levels, haar
from relume.operators.indirect_kernel import (
    BLOCK_SAMPLES,
    apply_rows,
    number_patches,
    select_coefficients,
    sum_by_patch,
    transform,
)
from relume.operators.interpolation import add_interpolated
from relume.transport.outgoing_patch_light import isotropic
from relume.transport.ray_projector import RayProjector
from relume.transport.roughness_ranges import contract_levels, split_by_level
from relume.transport.shading_points import GatherRays, ShadingPoints

F32 = NDArray[np.float32]

NUM_COEFFICIENTS = 128
_LEVEL_FRACTION = 0.3  # fraction of the expected light that is uniform over each wavelet level
_BLOCKS_PER_STEP = 8


@dataclass(frozen=True)
class IndirectOperator:
    """The operator from the light of patches to the image of one term.

    Attributes:
        coefficients: indices of the Haar coefficients of each block of samples.
        scale: scale of their quantized weights. weights: one channel if all are equal, else three.
        num_samples: number of samples of the image, without the padding of the last block.
        neighbor_weights: filter weights of neighboring samples.
    """

    coefficients: Shaped[NDArray[np.int32], "blocks K"]
    scale: Shaped[F32, "blocks K"]
    weights: Shaped[NDArray[np.int16], "blocks K channels block_samples"]
    num_samples: int
    neighbor_weights: csr_array

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        return self.coefficients.nbytes + self.scale.nbytes + self.weights.nbytes

    def add(self, light: Shaped[F32, "padded 3"], image: Shaped[F32, "tiles 3 samples"]) -> None:
        """Add the reflected light of patches, in place. Reads all weights once; memory-bound.

        Args:
            light: its Haar coefficients. image: added to.
        """
        args = (self.coefficients, self.scale, self.weights, light)
        unfiltered = np.empty((len(self.coefficients) * BLOCK_SAMPLES, 4), np.float32)
        parallel_for_chunks(lambda start, stop: apply_rows(*args, start, stop, unfiltered), len(self.coefficients))
        add_interpolated(self.neighbor_weights, unfiltered, image)


def row_bytes(num_samples: int, num_channels: int) -> int:
    """Return the memory of an operator's rows."""
    blocks = -(-num_samples // BLOCK_SAMPLES)
    return blocks * NUM_COEFFICIENTS * (2 * num_channels * BLOCK_SAMPLES + 8)


def num_channels(term: Term, bands: Mapping[str, NDArray[np.float64]]) -> int:
    """Return the channels of an operator's rows: one if a term weights all equally, else three."""
    upright = np.array([0, 0, 1], np.float32).reshape(3, 1)
    is_gray = all(
        np.all(c.num_rows == 1) and np.all(c.constant == c.constant[0]) for c in contract_levels(term, bands, None)
    )
    return 1 if is_gray and len(term.quotients(*upright, *upright)) == 1 else 3


def expected_light(radiance: Shaped[F32, "patches 3"]) -> Shaped[F32, " padded"]:
    """Estimate the magnitude of the Haar coefficients of light similar to the given radiance of patches."""
    magnitude = np.sqrt(np.square(haar(radiance)).sum(axis=1))
    level = coefficient_levels(len(magnitude))
    level_power = np.bincount(level, np.square(magnitude)) / np.bincount(level)
    expected = magnitude + _LEVEL_FRACTION * np.sqrt(level_power)[level]
    return np.asarray(expected if expected.any() else 0.5**level, np.float32)


def precompute_rows(
    term: Term,
    bands: Mapping[str, NDArray[np.float64]],
    receivers: ShadingPoints,
    rays: GatherRays,
    expected: Shaped[F32, " padded"],
    progress: Callable[[float], None],
    is_canceled: Callable[[], bool],
) -> IndirectOperator:
    """Contract all curves of a term along the gather rays of points.

    Args:
        bands: bands of each curve that depends on wi. (3, J) each, or (L, 3, J) if it depends on the level
        receivers: their light is not used. rays: of these; their outgoing light is not used.
        expected: from `expected_light`.
        progress: called with the completed fraction. is_canceled: polled.
    Raises:
        CancelledError: `is_canceled` returned True.
    """
    unit_lit = replace(receivers, rays=(replace(rays, outgoing=isotropic(np.ones_like(rays.outgoing.isotropic))),))
    contractions, num_samples = contract_levels(term, bands, None), len(receivers.normal)
    blocks = -(-num_samples // BLOCK_SAMPLES)
    rows = IndirectOperator(
        np.empty((blocks, NUM_COEFFICIENTS), np.int32),
        np.empty((blocks, NUM_COEFFICIENTS), np.float32),
        np.empty((blocks, NUM_COEFFICIENTS, num_channels(term, bands), BLOCK_SAMPLES), np.int16),
        num_samples,
        _identity_weights(num_samples) if rays.sharing is None else rays.sharing.weights(term, 0, num_samples),
    )

    def step(first: int, last: int) -> None:
        projectors = [RayProjector(term, contraction, unit_lit, BLOCK_SAMPLES) for contraction in contractions]
        maker = _RowMaker(projectors, receivers.level, rays, expected)
        for block in range(first, last):
            maker.write(rows, block)

    parallel_for_cancellable(step, blocks, _BLOCKS_PER_STEP, progress, is_canceled, "precomputing")
    return rows


def _identity_weights(num_samples: int) -> csr_array:
    return eye_array(num_samples, dtype=np.float32, format="csr")


class _RowMaker:
    """Computes rows block by block; holds the scratch memory of one thread."""

    def __init__(
        self,
        projectors: Sequence[RayProjector],
        level: NDArray[np.uint8] | None,
        rays: GatherRays,
        expected: F32,
    ) -> None:
        self._projectors, self._level = projectors, level
        self._gather_hits, self._expected = rays.gather_hits, expected
        self._patch_row = np.empty(len(expected), np.int32)
        max_coefficients = len(expected) + 1
        self._index = np.empty(max_coefficients, np.int32)
        # pages are allocated as they are written
        self._details = np.empty(max_coefficients * 3 * BLOCK_SAMPLES, np.float32)

    def write(self, rows: IndirectOperator, block: int) -> None:
        """Compute one block."""
        start, channels = block * BLOCK_SAMPLES, rows.weights.shape[2]
        stop = min(start + BLOCK_SAMPLES, rows.num_samples)
        patches = number_patches(self._gather_hits, start, stop, self._patch_row)
        if len(patches) == 0:
            rows.coefficients[block], rows.scale[block], rows.weights[block] = 0, 0, 0
            return
        level_runs = split_by_level(self._level, len(self._projectors), start, stop)
        weights = [self._projectors[level].weight_rays(first, last) for level, first, last in level_runs]
        weight = np.concatenate(weights, axis=1)[:channels]
        sums = np.zeros((len(patches), channels, BLOCK_SAMPLES), np.float32)
        sum_by_patch(self._gather_hits, start, stop, self._patch_row, weight, sums)
        width = channels * BLOCK_SAMPLES
        details = self._details[: len(self._index) * width].reshape(-1, width)
        num_levels = len(self._expected).bit_length() - 1
        num_coefficients = transform(patches, sums.reshape(-1, width), num_levels, self._index, details)
        select_coefficients(
            self._index[:num_coefficients], details[:num_coefficients], self._expected,
            rows.coefficients[block], rows.scale[block], rows.weights[block].reshape(NUM_COEFFICIENTS, width),
        )  # fmt: skip
