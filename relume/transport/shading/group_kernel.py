"""Kernels of light clusters: find those that a point sees entirely, and those that are accurate enough as one light."""

from __future__ import annotations

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT
from relume.transport.shading.light_list_kernel import (
    allocate_chunks,
    band_scales,
    defer_triangles,
    error_tolerance,
    evaluate_listed,
    per_axis,
)
from relume.transport.shading.table_averages import CHUNK, sum_up


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def select_groups(visibility_words, first, group_lights, whole):  # type: ignore[no-untyped-def]
    """Find groups of which a point sees all lights, and clear these lights' visibility.

    Args:
        visibility_words: of each light, bit k for point k; cleared for lights of entirely visible groups. (M,) uint64
        first, group_lights: see `relume.lights.spherical_triangles.LightClusters`. whole: visibility of each group,
            written. (G,) uint64
    """
    for g in range(whole.shape[0]):
        begin, end = first[g], first[g + 1]
        common_word = visibility_words[group_lights[begin]]
        for k in range(begin + 1, end):
            common_word &= visibility_words[group_lights[k]]
        whole[g] = common_word
        if common_word:
            for k in range(begin, end):
                visibility_words[group_lights[k]] &= ~common_word


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _restore_lights(bits, first, group_lights, group):  # type: ignore[no-untyped-def]
    """Set the visibility of a group's lights, to shade them individually."""
    for k in range(first[group], first[group + 1]):
        bits[group_lights[k] >> 3] |= np.uint8(1) << np.uint8(group_lights[k] & 7)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def add_groups(  # type: ignore[no-untyped-def]
    normal, tangent, light_list, local_wo, lights, groups, axes, curves, start, stop, visible, out
):
    """Add groups that are accurate enough as one light; restore the lights of the others.

    Args:
        normal, tangent, axes, curves, start, stop, out: as in `shade_points`.
        light_list: first, light and shading of the listed groups. local_wo: local view direction of the same list.
        lights: nodes, irradiance_radius and `between_variance` of the groups. groups: first and light_index, see
            `LightClusters`.
        visible: of the points; lights to shade individually are set. (points, bytes)
    """
    num_curves, (scale, num_rows) = axes.shape[0], band_scales(curves)
    chunks = allocate_chunks(lights[0].shape[0] // CHUNK + 1, num_rows)
    local, scratch = np.empty((3, 6, CHUNK), np.float32), np.empty((11, CHUNK), np.float32)
    wo, total, chunk_range = np.empty((num_curves, 3), np.float32), np.empty(3, np.float32), np.empty(CHUNK, np.float32)
    scratch_arrays = (chunks, local, scratch, wo, total, chunk_range)
    _add(
        normal,
        tangent,
        light_list,
        local_wo,
        lights,
        groups,
        axes,
        (curves, scale),
        start,
        stop,
        scratch_arrays,
        visible,
        out,
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add(  # type: ignore[no-untyped-def]
    normal, tangent, light_list, local_wo, lights, groups, axes, curves, start, stop, scratch_arrays, visible, out
):
    """Implement `add_groups` in the memory that it allocates."""
    (first, light, shading), (curves, scale) = light_list, curves
    chunks, local, scratch, wo, total, chunk_range = scratch_arrays
    weight, _, deferred, value, error = chunks
    for p in range(start, stop):
        row = p - start
        begin, end = first[row], first[row + 1]
        if begin == end:
            continue
        per_axis(axes, local_wo, begin, wo)
        total[:] = 0
        evaluate_listed(
            normal[p], tangent[p], (light, shading), begin, end, lights, curves, scale, wo, local, scratch, chunk_range,
            chunks, total,
        )  # fmt: skip
        tolerance = error_tolerance(total, out[row, :, 0])
        total[:] = 0
        for chunk in range((end - begin + CHUNK - 1) // CHUNK):
            at = begin + chunk * CHUNK
            num = min(CHUNK, end - at)
            for n in deferred[
                chunk, : defer_triangles(value[chunk], weight[chunk], error[chunk], num, tolerance, deferred[chunk])
            ]:
                _restore_lights(visible[row], groups[0], groups[1], light[at + n])
            sum_up(value[chunk], weight[chunk], num, total)
        for channel in range(3):
            out[row, channel, 0] += total[channel]
