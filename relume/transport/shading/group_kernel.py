"""Kernels of light clusters: find those that a point sees entirely, and those that are accurate enough as one light."""

from __future__ import annotations

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT
from relume.transport.shading.light_list_kernel import defer_triangles, error_tolerance, evaluate_listed
from relume.transport.shading.table_averages import CHUNK, sum_up

_WHOLE = np.float32(0.999)  # share t above which a group is shaded as one light


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


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def restore_shared(listed, share, first, group_lights, num, visible, shading):  # type: ignore[no-untyped-def]
    """Restore the lights of groups that share their light with lobe rays, and set the groups' shading to zero.

    Args:
        listed: the groups, `ListedLights`. share: t of each entry. first, group_lights: as in `select_groups`.
        num: number of points. visible: as in `add_groups`. shading: of each entry, written. (1 or 3, ≥ K)
    """
    for row in range(num):
        for entry in range(listed.first[row], listed.first[row + 1]):
            if share[entry] < _WHOLE:
                _restore_lights(visible[row], first, group_lights, listed.light[entry])
                shading[:, entry] = 0


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def add_groups(points, listed, shading, table, groups, curves, start, stop, scratch, visible, out):  # type: ignore[no-untyped-def]
    """Add groups that are accurate enough as one light; restore the lights of the others.

    Args:
        points, listed, shading, table, curves, start, stop, out: as in `shade_points`, for groups instead of lights.
        groups: first and light_index, see `LightGroups`. scratch: `ListScratch`.
        visible: of the points; lights to shade individually are set. (points, bytes)
    """
    (weight, _, deferred, value, error), total = scratch.chunks, scratch.total
    for p in range(start, stop):
        row = p - start
        begin, end = listed.first[row], listed.first[row + 1]
        if begin == end:
            continue
        evaluate_listed(points.normal[p], points.tangent[p], listed, shading, begin, end, table, curves, scratch)
        tolerance = error_tolerance(total, out[row, :, 0])
        total[:] = 0
        for chunk in range((end - begin + CHUNK - 1) // CHUNK):
            at = begin + chunk * CHUNK
            num = min(CHUNK, end - at)
            count = defer_triangles(value[chunk], weight[chunk], error[chunk], num, tolerance, deferred[chunk])
            for n in deferred[chunk, :count]:
                _restore_lights(visible[row], groups[0], groups[1], listed.light[at + n])
            sum_up(value[chunk], weight[chunk], num, total)
        for channel in range(3):
            out[row, channel, 0] += total[channel]
