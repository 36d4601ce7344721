"""What a term's operator is made of: all of its samples in float32 where the memory has room for that, else less.

Where an operator would take a hand's patience, a rough one is there first, by which the picture goes on
(docs/direct-light.md#algorithm).

What a hand is on is followed whatever the picture's size. An operator along a curve of 256 bands takes 3 kB a sample,
6.4 GB where a material fills 1920×1080 pixels. In 16 bits it is half of that, to 10⁻⁴; where that is too much, one
sample of each square of pixels says how the picture changes. At rest every sample is shaded
(docs/direct-light.md#algorithm).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.thread_pools import num_threads
from relume.live.fixed_camera.material_image import MaterialImage
from relume.operators.linear_operator import LinearOperator, operator_bytes, quantized_bytes
from relume.operators.quantized import QuantizedOperator
from relume.operators.subsampled import NUM_NEIGHBORS, SubsampledOperator, subsampled_bytes
from relume.transport.shading_points import GatherRays, RayList, ShadingPoints
from relume.views.gather_filter import make_neighbor_filter
from relume.views.pixel_blocks import nearest_chosen, one_per_block
from relume.views.view import View

_SPARE_BUDGET_DIVISOR = (
    8  # of the budget, left beside a packed one: an image that is shaded at rest must not push it out
)
_SUBSAMPLED_BUDGET_DIVISOR = (
    2  # an operator of some samples takes the budget over this: images have room beside it, another one follows
)
_MAX_STEP = 8
_MIN_SAMPLES = 256  # samples; fewer do not say where a highlight is
_SLOW_PAIRS_PER_THREAD = (
    12_000_000  # pairs of samples and lights a thread, of which it takes a third of a second and more
)
_MIN_LIGHTS_TO_MERGE = 800  # lights, of which less than half would be left to merge into
_SOFTENING = 0.05  # pixels²; what a chosen sample's own neighbours have of it


class OperatorForm(NamedTuple):
    """What an operator is made of.

    Attributes:
        step: one sample of each square of so many pixels; 1: all. is_quantized: in 16 bits.
        is_merged_light: of merged lights.
    """

    step: int
    is_quantized: bool
    is_merged_light: bool = False

    def num_bytes(self, material: MaterialImage, num_columns: int) -> int:
        """Memory that it takes of a material's term. num_columns: in each channel."""
        if self.step > 1:
            return subsampled_bytes(material.num_samples, material.num_pixel_blocks(self.step), num_columns)
        return (quantized_bytes if self.is_quantized else operator_bytes)(material.num_samples, num_columns)


EXACT = OperatorForm(1, is_quantized=False)
QUANTIZED = OperatorForm(1, is_quantized=True)
MERGED_LIGHT = OperatorForm(1, is_quantized=False, is_merged_light=True)


def operator_form(material: MaterialImage, num_columns: int, budget_bytes: int) -> OperatorForm | None:
    """The best form of an operator that fits; None where none does, and the hand has to be waited for.

    Args:
        material: whose samples. num_columns: of the operator, in each channel. budget_bytes: of the memory.
    """
    if EXACT.num_bytes(material, num_columns) <= budget_bytes:
        return EXACT
    if QUANTIZED.num_bytes(material, num_columns) <= budget_bytes - budget_bytes // _SPARE_BUDGET_DIVISOR:
        return QUANTIZED
    for step in range(2, _MAX_STEP + 1):
        form = OperatorForm(step, is_quantized=True)
        if form.num_bytes(material, num_columns) <= budget_bytes // _SUBSAMPLED_BUDGET_DIVISOR:
            return form if material.num_pixel_blocks(step) >= _MIN_SAMPLES else None
    return None


def use_coarse(material: MaterialImage, num_columns: int, num_lights: int, budget_bytes: int) -> bool:
    """Whether an exact operator takes so long to be made that a rough one is to be there first, and both fit.

    Args:
        material, num_columns, budget_bytes: as in `operator_form`. num_lights: that its samples may see.
    """
    is_slow = (
        num_lights >= _MIN_LIGHTS_TO_MERGE
        and material.num_samples * num_lights > _SLOW_PAIRS_PER_THREAD * num_threads()
    )
    return is_slow and 2 * EXACT.num_bytes(material, num_columns) <= budget_bytes


def precompute_subsampled(
    view: View,
    material: int,
    step: int,
    receivers: ShadingPoints,
    precompute: Callable[[ShadingPoints], LinearOperator | QuantizedOperator],
) -> SubsampledOperator:
    """An operator of one sample of each square of pixels.

    Args:
        view: whose samples. material: its index. step: side of a square.
        receivers: all samples of the material, with what arrives at them.
        precompute: makes the operator of those that are chosen.
    """
    sample_indices = one_per_block(view, material, step)
    neighbors, weight = nearest_chosen(view, material, sample_indices, step, NUM_NEIGHBORS, _SOFTENING)
    return SubsampledOperator(
        precompute(_subsample(view, material, step, receivers, sample_indices)), len(sample_indices), neighbors, weight
    )


def _subsample(
    view: View, material: int, step: int, receivers: ShadingPoints, sample_indices: NDArray[np.intp]
) -> ShadingPoints:
    """Some of a material's samples, which share gather rays as those of a picture do that is as much smaller."""
    subset = receivers.subset(sample_indices)
    y, x = np.divmod(view.pixel[view.rows(material)][sample_indices], np.uint32(view.width))
    width = -(-view.width // step)
    block = (y // step * width + x // step).astype(np.uint32)

    def shared(subset_rays: RayList, all_rays: RayList) -> RayList:
        if not (
            isinstance(subset_rays, GatherRays) and isinstance(all_rays, GatherRays) and all_rays.sharing is not None
        ):
            return subset_rays
        return replace(
            subset_rays, sharing=make_neighbor_filter(block, width, subset.points, all_rays.sharing.diffuse.num_passes)
        )

    return replace(subset, rays=tuple(map(shared, subset.rays, receivers.rays)))
