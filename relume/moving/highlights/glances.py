"""What points see of the sky in their lobes: bits of light triangles, weighed by light.

What is weighed with what, `relume.moving.highlights.lobe_lights` says. A lamp is seen as much as the lights by which it
comes, wherever a lobe looks.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.moving.basis.lobes import Lobes
from relume.moving.highlights.lobe_lights import MOST_LAMPS, LobeLights, square_of, weight_of, width_of
from relume.moving.highlights.looking import along_both
from relume.moving.points.surface import Surface
from relume.parallel import for_shares
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _middle(one, other, first, sigma, sigma_2):  # type: ignore[no-untyped-def]
    """Find the mean direction of two lobes, three numbers, and how wide both are together, σ²."""
    x = first * one[0] + (np.float32(1) - first) * other[0]
    y = first * one[1] + (np.float32(1) - first) * other[1]
    z = first * one[2] + (np.float32(1) - first) * other[2]
    length = math.sqrt(x * x + y * y + z * z)
    per = np.float32(1) / length
    own = first * sigma * sigma + (np.float32(1) - first) * sigma_2 * sigma_2
    return per * x, per * y, per * z, own + max(np.float32(1) - length, np.float32(0))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _glance(points, material, visible, listed, lobes, eye, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Look along lobes from the points that are [start, stop) of rows."""
    position, normal, _, _, _ = points
    for p in rows[start:stop]:
        lobe = lobes.of[material[p]]
        out[p] = 0
        if lobe < 0:
            continue
        n = normal[p, 0], normal[p, 1], normal[p, 2]
        x, y, z = position[p, 0] - eye[0], position[p, 1] - eye[1], position[p, 2] - eye[2]
        scale = np.float32(1) / math.sqrt(max(x * x + y * y + z * z, np.float32(1e-20)))
        _, _, one, other, first, sigma, sigma_2 = along_both(lobes, lobe, n, (scale * x, scale * y, scale * z))
        x, y, z, variance = _middle(one, other, first, sigma, sigma_2)
        place = listed.first[width_of(math.sqrt(variance))] + square_of(x, y, z)
        seen, total = np.float32(0), np.float32(1e-30)
        for k in range(listed.lists.shape[1]):
            light = listed.lists[place, k]
            if light < 0:
                break
            weight = weight_of(listed.lights, light, x, y, z, variance)
            total += weight
            if (visible[p, light >> 3] >> (light & 7)) & 1:
                seen += weight
        out[p, 0] = seen / total
        for lamp in range(listed.lamps.shape[0]):
            seen = np.float32(0)
            for k in range(listed.lamps.shape[1]):
                light = listed.lamps[lamp, k]
                if light < 0:
                    break
                if (visible[p, light >> 3] >> (light & 7)) & 1:
                    seen += listed.share[lamp, k]
            out[p, 1 + lamp] = seen


def glance(
    surface: Surface,
    visible: NDArray[np.uint8],
    listed: LobeLights,
    lobes: Lobes,
    eye: F32,
    is_needed: NDArray[np.uint8],
    out: F32 | None = None,
) -> F32:
    """Look from points along their lobes.

    Args:
        surface: whose points. visible: light l of a point in bit l & 7 of byte l >> 3. (points, bytes) uint8
        listed: lights of the sky. lobes: of all materials. eye: where it is. (3,) float32
        is_needed: points that are asked. (points,) uint8
        out: written where needed; None: the others see nothing.
    Returns:
        V, the share of the sky's light that is seen there; then that of each lamp.
        (points, 3) float32
    """
    found = np.zeros((len(visible), 1 + MOST_LAMPS), np.float32) if out is None else out
    rows = np.flatnonzero(is_needed.view(np.bool_))
    args = surface.points, surface.material, visible, listed, lobes, np.ascontiguousarray(eye, np.float32), rows
    for_shares(lambda start, stop: _glance(*args, start, stop, found), len(rows))
    return found
