"""What points see of the sky in their lobes: bits of light triangles, weighed by light.

What is weighed with what, `relume.live.free_camera.highlights.lobe_light_lists` says. A lamp is seen as much as the
lights by which it comes, wherever a lobe looks.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.basis.highlight_lobes import Lobes
from relume.live.free_camera.highlights.environment_lobe_lookup import evaluate_two_lobes
from relume.live.free_camera.highlights.lobe_light_lists import (
    MAX_BRIGHT_LIGHTS,
    LobeLightLists,
    bin_of,
    light_weight,
    width_index,
)
from relume.live.free_camera.probes.stored_scene import StoredScene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _mean_lobe(direction_1, direction_2, weight_1, sigma_1, sigma_2):  # type: ignore[no-untyped-def]
    """Find the mean direction of two lobes, three numbers, and how wide both are together, σ²."""
    x = weight_1 * direction_1[0] + (np.float32(1) - weight_1) * direction_2[0]
    y = weight_1 * direction_1[1] + (np.float32(1) - weight_1) * direction_2[1]
    z = weight_1 * direction_1[2] + (np.float32(1) - weight_1) * direction_2[2]
    length = math.sqrt(x * x + y * y + z * z)
    inverse_length = np.float32(1) / length
    variance = weight_1 * sigma_1 * sigma_1 + (np.float32(1) - weight_1) * sigma_2 * sigma_2
    return (
        inverse_length * x,
        inverse_length * y,
        inverse_length * z,
        variance + max(np.float32(1) - length, np.float32(0)),
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _trace_lobe_visibility(  # type: ignore[no-untyped-def]
    probes, material, visibility_bits, lobe_lights, lobes, camera_position, rows, start, stop, out
):
    """Look along lobes from the points that are [start, stop) of rows."""
    position, normal, _, _, _ = probes
    for p in rows[start:stop]:
        lobe = lobes.lobe_index[material[p]]
        out[p] = 0
        if lobe < 0:
            continue
        n = normal[p, 0], normal[p, 1], normal[p, 2]
        x, y, z = (
            position[p, 0] - camera_position[0],
            position[p, 1] - camera_position[1],
            position[p, 2] - camera_position[2],
        )
        scale = np.float32(1) / math.sqrt(max(x * x + y * y + z * z, np.float32(1e-20)))
        _, _, direction_1, direction_2, weight_1, sigma_1, sigma_2 = evaluate_two_lobes(
            lobes, lobe, n, (scale * x, scale * y, scale * z)
        )
        x, y, z, variance = _mean_lobe(direction_1, direction_2, weight_1, sigma_1, sigma_2)
        list_index = lobe_lights.first[width_index(math.sqrt(variance))] + bin_of(x, y, z)
        visible_weight, total_weight = np.float32(0), np.float32(1e-30)
        for k in range(lobe_lights.lists.shape[1]):
            light = lobe_lights.lists[list_index, k]
            if light < 0:
                break
            weight = light_weight(lobe_lights.lights, light, x, y, z, variance)
            total_weight += weight
            if (visibility_bits[p, light >> 3] >> (light & 7)) & 1:
                visible_weight += weight
        out[p, 0] = visible_weight / total_weight
        for bright_light in range(lobe_lights.bright_lights.shape[0]):
            visible_weight = np.float32(0)
            for k in range(lobe_lights.bright_lights.shape[1]):
                light = lobe_lights.bright_lights[bright_light, k]
                if light < 0:
                    break
                if (visibility_bits[p, light >> 3] >> (light & 7)) & 1:
                    visible_weight += lobe_lights.bright_light_weights[bright_light, k]
            out[p, 1 + bright_light] = visible_weight


def trace_lobe_visibility(
    stored_scene: StoredScene,
    visibility_bits: NDArray[np.uint8],
    lobe_lights: LobeLightLists,
    lobes: Lobes,
    camera_position: F32,
    is_needed: NDArray[np.uint8],
    out: F32 | None = None,
) -> F32:
    """Look from points along their lobes.

    Args:
        stored_scene: whose points. visibility_bits: light l of a point in bit l & 7 of byte l >> 3. (points, bytes)
            uint8
        lobe_lights: lights of the sky. lobes: of all materials. camera_position: where it is. (3,) float32
        is_needed: points that are asked. (points,) uint8
        out: written where needed; None: the others see nothing.
    Returns:
        V, the share of the sky's light that is seen there; then that of each lamp.
        (points, 3) float32
    """
    lobe_visibility = np.zeros((len(visibility_bits), 1 + MAX_BRIGHT_LIGHTS), np.float32) if out is None else out
    rows = np.flatnonzero(is_needed.view(np.bool_))
    args = (
        stored_scene.probes,
        stored_scene.material,
        visibility_bits,
        lobe_lights,
        lobes,
        np.ascontiguousarray(camera_position, np.float32),
        rows,
    )
    parallel_for_chunks(lambda start, stop: _trace_lobe_visibility(*args, start, stop, lobe_visibility), len(rows))
    return lobe_visibility
