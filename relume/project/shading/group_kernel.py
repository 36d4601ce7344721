"""The kernels of groups of lights: which of them points see wholly, and which are near enough to one light each."""

from __future__ import annotations

import numba as nb
import numpy as np

from relume.project.shading.boxes import CHUNK, sum_up
from relume.project.shading.listed import by_axes, evaluate_listed, least_of, room, scales_of, set_aside
from relume.uncounted import UNCOUNTED


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def take_whole(words, first, part, whole):  # type: ignore[no-untyped-def]
    """Find groups all of whose lights a point sees, and take these lights away from it.

    Args:
        words: of each light, bit k for point k; lights of whole groups are taken out. (M,) uint64
        first, part: of `relume.light.triangles.Groups`. whole: of each group, written. (G,) uint64
    """
    for g in range(whole.shape[0]):
        begin, end = first[g], first[g + 1]
        seen = words[part[begin]]
        for k in range(begin + 1, end):
            seen &= words[part[k]]
        whole[g] = seen
        if seen:
            for k in range(begin, end):
                words[part[k]] &= ~seen


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _give_back(bits, first, part, group):  # type: ignore[no-untyped-def]
    """Let a point see the lights of a group by themselves."""
    for k in range(first[group], first[group + 1]):
        bits[part[k] >> 3] |= np.uint8(1) << np.uint8(part[k] & 7)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def add_groups(  # type: ignore[no-untyped-def]
    normal, tangent, listed, local_wo, lights, parts, axes, curves, start, stop, visible, out
):
    """Add what those groups bring to points that are near enough to one light; lights of others are given back.

    Args:
        normal, tangent, axes, curves, start, stop, out: as in `shade_points`.
        listed: first, light and shading of it, for groups. local_wo: of it as well.
        lights: nodes, brings and `between` of the groups. parts: first and part of them, see `Groups`.
        visible: of the points, lights of listed groups that are to be shaded one by one are set. (points, bytes)
    """
    num_curves, (scale, num_rows) = axes.shape[0], scales_of(curves)
    chunks = room(lights[0].shape[0] // CHUNK + 1, num_rows)
    local, scratch = np.empty((3, 6, CHUNK), np.float32), np.empty((11, CHUNK), np.float32)
    wo, total, share = np.empty((num_curves, 3), np.float32), np.empty(3, np.float32), np.empty(CHUNK, np.float32)
    memory = (chunks, local, scratch, wo, total, share)
    _add(normal, tangent, listed, local_wo, lights, parts, axes, (curves, scale), start, stop, memory, visible, out)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _add(  # type: ignore[no-untyped-def]
    normal, tangent, listed, local_wo, lights, parts, axes, curves, start, stop, memory, visible, out
):
    """Do what `add_groups` is for, in the memory that it has made."""
    (first, light, shading), (curves, scale) = listed, curves
    chunks, local, scratch, wo, total, share = memory
    weight, _, which, value, error = chunks
    for p in range(start, stop):
        row = p - start
        begin, end = first[row], first[row + 1]
        if begin == end:
            continue
        by_axes(axes, local_wo, begin, wo)
        total[:] = 0
        evaluate_listed(
            normal[p], tangent[p], (light, shading), begin, end, lights, curves, scale, wo, local, scratch, share,
            chunks, total,
        )  # fmt: skip
        least = least_of(total, out[row, :, 0])
        total[:] = 0
        for chunk in range((end - begin + CHUNK - 1) // CHUNK):
            at = begin + chunk * CHUNK
            num = min(CHUNK, end - at)
            for n in which[chunk, : set_aside(value[chunk], weight[chunk], error[chunk], num, least, which[chunk])]:
                _give_back(visible[row], parts[0], parts[1], light[at + n])
            sum_up(value[chunk], weight[chunk], num, total)
        for channel in range(3):
            out[row, channel, 0] += total[channel]
