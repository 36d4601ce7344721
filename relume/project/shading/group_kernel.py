"""The kernels of groups of lights: which of them points see wholly, and which are near enough to one light each."""

from __future__ import annotations

import numba as nb
import numpy as np

from relume.project.shading.boxes import CHUNK, evaluate, look_up_middles, turn, weigh

# A group may be wrong by a share of what it brings, or by a share of all that the point receives.
_TOLERANCE, _TOLERANCE_OF_ALL = np.float32(0.02), np.float32(1e-3)


@nb.njit(nogil=True, cache=True)
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


@nb.njit(nogil=True, cache=True)
def _give_back(bits, first, part, group):  # type: ignore[no-untyped-def]
    """Let a point see the lights of a group by themselves."""
    for k in range(first[group], first[group + 1]):
        bits[part[k] >> 3] |= np.uint8(1) << np.uint8(part[k] & 7)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _brought(value, weight, n):  # type: ignore[no-untyped-def]
    """What group n brings, per channel. value: (1 or 3, > n). weight: (3, > n)"""
    blue_row = value.shape[0] - 1
    return weight[0, n] * value[0, n], weight[1, n] * value[blue_row // 2, n], weight[2, n] * value[blue_row, n]


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
    first, light, shading = listed
    nodes, brings, between = lights
    num_curves, num_rows, num_chunks = axes.shape[0], 1, nodes.shape[0] // CHUNK + 1
    scale, wo = np.empty(num_curves, np.float32), np.empty((num_curves, 3), np.float32)
    for k in range(num_curves):
        num_rows = max(num_rows, curves[2][k])
        scale[k] = curves[3][k] / (np.pi / 2)
    local, scratch = np.empty((3, 6, CHUNK), np.float32), np.empty((11, CHUNK), np.float32)
    lean = np.empty(CHUNK, np.float32)
    weight, reach = np.empty((num_chunks, 3, CHUNK), np.float32), np.empty((num_chunks, CHUNK), np.float32)
    value, error = np.empty((num_chunks, num_rows, CHUNK), np.float32), np.empty((num_chunks, CHUNK), np.float32)
    for p in range(start, stop):
        row = p - start
        begin, end = first[row], first[row + 1]
        if begin == end:
            continue
        for k in range(num_curves):
            for axis in range(3):
                wo[k, axis] = axes[k, axis] * local_wo[axis, begin]
        total = abs(out[row, 0, 0]) + abs(out[row, 1, 0]) + abs(out[row, 2, 0])
        for chunk in range((end - begin + CHUNK - 1) // CHUNK):
            at = begin + chunk * CHUNK
            num = min(CHUNK, end - at)
            look_up_middles(nodes, light, at, num, local)
            turn(normal[p], tangent[p], 3, num, local)
            weigh(brings, light, shading, at, num, weight[chunk], reach[chunk])
            for n in range(num):
                lean[n] = between[light[at + n]]
            evaluate(curves, scale, wo, local, reach[chunk], lean, num, scratch, value[chunk], error[chunk])
            for n in range(num):
                red, green, blue = _brought(value[chunk], weight[chunk], n)
                total += red + green + blue
        least = _TOLERANCE_OF_ALL * total
        for chunk in range((end - begin + CHUNK - 1) // CHUNK):
            at = begin + chunk * CHUNK
            for n in range(min(CHUNK, end - at)):
                red, green, blue = _brought(value[chunk], weight[chunk], n)
                if error[chunk, n] > _TOLERANCE and error[chunk, n] * (red + green + blue) > least:
                    _give_back(visible[row], parts[0], parts[1], light[at + n])
                else:
                    out[row, 0, 0] += red
                    out[row, 1, 0] += green
                    out[row, 2, 0] += blue
