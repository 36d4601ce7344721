"""Environment lights and highlight shapes, as arrays for shaders (docs/free-camera.md#highlights)."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.free_camera.basis.highlight_lobes import Lobes
from relume.live.free_camera.basis.lobe_shapes import NUM_AZIMUTHS, NUM_GRID_DIRECTIONS
from relume.live.free_camera.basis.outgoing_coefficients import NUM_ROWS
from relume.live.free_camera.highlights.interpolated_highlights import NORMAL_VARIANCE_FACTOR
from relume.live.free_camera.highlights.light_sum_kernel import EnvironmentLights

F32 = NDArray[np.float32]
Texels = NDArray[Any]

_MAX_HALF = 65504.0


def environment_light_array(lights: EnvironmentLights) -> dict[str, Texels]:
    """Return the direction and width index of each light, then its irradiance.

    Args:
        lights: lights of the environment.
    Returns:
        (2 lights, 4) float32
    """
    width = (lights.table // NUM_GRID_DIRECTIONS).astype(np.float32)
    directions, irradiance = np.split(lights.lights, 2, axis=1)
    rows = np.column_stack([directions, width, irradiance, np.zeros_like(width)])
    return {"environment_lights": np.ascontiguousarray(rows.reshape(-1, 4))}


def lobe_shape_array(lobes: Lobes, material: int, normal_variation: Shaped[F32, " materials"]) -> dict[str, Texels]:
    """Return the table of a material's highlight.

    Args:
        lobes: of all materials. material: one with a lobe. normal_variation: of all, see
            `relume.probes.stored_scene.StoredScene`.
    Returns:
        Of each row 1 − β, α², and the weight of the table for varying normals; then, for each width and ring, the
        values at its first four azimuths, and at its last four. (rows · (1 + widths · rings · 2), 4) float16
    """
    lobe = int(lobes.lobe_index[material])
    ring_values = lobes.shape[lobe].reshape(NUM_ROWS, -1, NUM_AZIMUTHS)
    halves = np.stack([ring_values[..., :4], ring_values[..., -4:]], axis=2).reshape(NUM_ROWS, -1, 4)
    sigma2, head = np.square(lobes.sigma[lobe].min(axis=1)), np.zeros((NUM_ROWS, 1, 4), np.float32)
    head[:, 0, 0], head[:, 0, 1] = lobes.lobe_confidence[lobe], lobes.flatness[lobe]
    head[:, 0, 2] = sigma2 / (sigma2 + NORMAL_VARIANCE_FACTOR * normal_variation[material])
    texels = np.clip(np.concatenate([head, halves], axis=1), -_MAX_HALF, _MAX_HALF)
    return {f"shapes/{material}": texels.astype(np.float16).reshape(-1, 4)}
