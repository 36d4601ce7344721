"""Forms of a term's operator that fit the memory budget: all samples in float32 if possible, else compact forms.

If the exact operator would delay a drag, a coarse one is computed first and updates the image meanwhile.

A drag is followed at any image size. An operator along a curve of 256 bands takes 3 kB per sample, 6.4 GB if a material
fills 1920×1080 pixels. 16 bits halve that, with an error of 10⁻⁴; if that is still too large, one sample per pixel
block determines the change of the image. When the drag ends, every sample is shaded (docs/direct-light.md#algorithm).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.core.thread_pools import num_threads
from relume.live.fixed_camera.material_image import MaterialImage
from relume.operators.linear_operator import NUM_NEIGHBORS, Compression, Interpolation, LinearOperator, operator_bytes
from relume.patches.neighbor_filter import NeighborFilter
from relume.transport.shading_points import GatherRays, RayList, ShadingPoints
from relume.views.pixel_blocks import nearest_chosen, one_per_block
from relume.views.view import View

_SPARE_BUDGET_DIVISOR = (
    8  # fraction left free beside a quantized operator, so that a newly shaded image does not evict it
)
_SUBSAMPLED_BUDGET_DIVISOR = (
    2  # a subsampled operator takes at most this fraction: images and a second operator need room
)
_MAX_STEP = 8
_MIN_SAMPLES = 256  # samples; fewer do not resolve a highlight
_SLOW_PAIRS_PER_THREAD = 12_000_000  # pairs of samples and lights per thread that take at least a third of a second
_MIN_LIGHTS_TO_MERGE = 800  # with fewer lights, merging leaves more than half of the lights
_SOFTENING = 0.05  # pixels²; smooths the interpolation weights near a shaded sample


EXACT, QUANTIZED = Compression(), Compression(bits=16)
MERGED_LIGHT = Compression(has_merged_lights=True)


def compressed_bytes(material: MaterialImage, num_columns: int, form: Compression) -> int:
    """Return the memory of an operator for a term of a material.

    Args:
        material: the image of a material. num_columns: number of columns of the operator, in each channel.
        form: compression of the operator.
    """
    num_selected = None if form.step == 1 else material.num_pixel_blocks(form.step)
    return operator_bytes(material.num_samples, num_columns, form.bits, num_selected)


def operator_form(material: MaterialImage, num_columns: int, budget_bytes: int) -> Compression | None:
    """Return the best form of an operator that fits the budget; None if none does.

    Args:
        material: the image of a material. num_columns: number of columns of the operator, in each channel.
        budget_bytes: budget in bytes of the cache.
    """
    if compressed_bytes(material, num_columns, EXACT) <= budget_bytes:
        return EXACT
    if compressed_bytes(material, num_columns, QUANTIZED) <= budget_bytes - budget_bytes // _SPARE_BUDGET_DIVISOR:
        return QUANTIZED
    for step in range(2, _MAX_STEP + 1):
        form = Compression(step, bits=16)
        if compressed_bytes(material, num_columns, form) <= budget_bytes // _SUBSAMPLED_BUDGET_DIVISOR:
            return form if material.num_pixel_blocks(step) >= _MIN_SAMPLES else None
    return None


def use_coarse(material: MaterialImage, num_columns: int, num_lights: int, budget_bytes: int) -> bool:
    """Return whether the exact operator takes so long that a coarse one is computed first, and both fit the budget.

    Args:
        material, num_columns, budget_bytes: as in `operator_form`. num_lights: number of lights of its samples.
    """
    is_slow = (
        num_lights >= _MIN_LIGHTS_TO_MERGE
        and material.num_samples * num_lights > _SLOW_PAIRS_PER_THREAD * num_threads()
    )
    return is_slow and 2 * compressed_bytes(material, num_columns, EXACT) <= budget_bytes


def precompute_subsampled(
    view: View,
    material: int,
    step: int,
    receivers: ShadingPoints,
    precompute: Callable[[ShadingPoints], LinearOperator],
) -> LinearOperator:
    """Precompute an operator from one sample per pixel block.

    Args:
        view: the view. material: its index. step: side of a block.
        receivers: all samples of the material, with their incident light.
        precompute: computes the operator of the selected samples.
    """
    sample_indices = one_per_block(view, material, step)
    neighbors, weight = nearest_chosen(view, material, sample_indices, step, NUM_NEIGHBORS, _SOFTENING)
    operator = precompute(_subsample(view, material, step, receivers, sample_indices))
    return operator.interpolated(Interpolation(len(sample_indices), neighbors, weight))


def _subsample(
    view: View, material: int, step: int, receivers: ShadingPoints, sample_indices: NDArray[np.intp]
) -> ShadingPoints:
    """Select samples of a material; they share gather rays like the samples of a smaller image."""
    subset = receivers.subset(sample_indices)
    y, x = np.divmod(view.pixel[view.rows(material)][sample_indices], np.uint32(view.width))
    width = -(-view.width // step)
    block = (y // step * width + x // step).astype(np.uint32)

    def shared(subset_rays: RayList, all_rays: RayList) -> RayList:
        if not (
            isinstance(subset_rays, GatherRays) and isinstance(all_rays, GatherRays) and all_rays.sharing is not None
        ):
            return subset_rays
        inverse_distance = all_rays.sharing.inverse_distance[sample_indices]
        return replace(subset_rays, sharing=NeighborFilter.of_samples(block, width, subset.points, inverse_distance))

    return replace(subset, rays=tuple(map(shared, subset.rays, receivers.rays)))
