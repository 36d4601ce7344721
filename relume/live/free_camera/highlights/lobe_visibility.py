"""Visibility of the environment in lobes of probes, from visibility bits weighted by light.

`relume.live.free_camera.highlights.lobe_light_lists` defines the weights. A bright light is visible as far as the
triangles that contribute to it, for any direction of a lobe.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.basis.highlight_lobes import Lobes
from relume.live.free_camera.basis.table_index import view_direction
from relume.live.free_camera.highlights.environment_lobe_lookup import evaluate_two_lobes
from relume.live.free_camera.highlights.lobe_light_lists import (
    MAX_BRIGHT_LIGHTS,
    LobeLightLists,
    bin_of,
    light_weight,
    width_index,
)
from relume.probes.stored_scene import ViewedProbes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _mean_lobe(direction_1, direction_2, weight_1, sigma_1, sigma_2):  # type: ignore[no-untyped-def]
    """Return the mean direction of two lobes, three numbers, and their joint variance, σ²."""
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _trace_lobe_visibility(viewed, visibility_bits, lobe_lights, lobes, start, stop, out):  # type: ignore[no-untyped-def]
    """Evaluate lobe visibility of probes rows[start:stop]."""
    material, normal = viewed.material, viewed.points.normal
    for p in viewed.rows[start:stop]:
        lobe = lobes.lobe_index[material[p]]
        out[p] = 0
        if lobe < 0:
            continue
        n = normal[p, 0], normal[p, 1], normal[p, 2]
        x, y, z = view_direction(viewed, p)
        _, _, direction_1, direction_2, weight_1, sigma_1, sigma_2 = evaluate_two_lobes(lobes, lobe, n, (-x, -y, -z))
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
    viewed: ViewedProbes,
    visibility_bits: Shaped[NDArray[np.uint8], "probes bytes"],
    lobe_lights: LobeLightLists,
    lobes: Lobes,
    out: Shaped[F32, "probes 3"] | None = None,
) -> Shaped[F32, "probes 3"]:
    """Return the visibility of the environment in lobes of probes.

    Args:
        viewed: the probes to evaluate. visibility_bits: light l of a probe in bit l & 7 of byte l >> 3.
        lobe_lights: of the environment. lobes: of all materials.
        out: overwritten there; None: new, zero elsewhere.
    Returns:
        V, the visible fraction of environment light in the lobe; then that of each bright light.
    """
    lobe_visibility = np.zeros((len(visibility_bits), 1 + MAX_BRIGHT_LIGHTS), np.float32) if out is None else out
    args = viewed, visibility_bits, lobe_lights, lobes
    parallel_for_chunks(
        lambda start, stop: _trace_lobe_visibility(*args, start, stop, lobe_visibility), len(viewed.rows)
    )
    return lobe_visibility
