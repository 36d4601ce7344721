"""The linen under the tray, and the table that curves up into a wall."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene.examples.still_life.grids import GridSurface, closed_grid_surface, grid_surface, rotation_y
from relume.scene.examples.still_life.tray import distance_outside

F64 = NDArray[np.float64]

THICKNESS = 0.0016  # height of the flat cloth under the tray
CLOTH_ANGLE_DEG, CLOTH_CENTER, CLOTH_SIZE = -17.0, (0.05, 0.0, 0.095), (0.66, 0.46)
STAGE_RADIUS, STAGE_CURVE, STAGE_HEIGHT = 0.80, 0.34, 0.62


def smoothstep(t: Shaped[F64, "*points"]) -> Shaped[F64, "*points"]:
    """0 below 0, 1 above 1, 3t² − 2t³ between."""
    s = np.clip(t, 0, 1)
    return s * s * (3 - 2 * s)


def fold_height(x: Shaped[F64, "*points"], z: Shaped[F64, "*points"]) -> Shaped[F64, "*points"]:
    """Height of the cloth above the table: flat under the tray, with soft folds radiating from it."""
    free = smoothstep((distance_outside(x, z) - 0.024) / 0.075)
    bend = 0.016 * np.sin(11.0 * x + 4.0 * z) + 0.010 * np.sin(17.0 * z - 6.0 * x + 1.3)
    long = np.sin(62.0 * (0.83 * x - 0.56 * z + bend) + 0.6)
    cross = np.sin(47.0 * (0.35 * x + 0.94 * z - 1.4 * bend) + 2.2)
    fine = np.sin(118.0 * (0.62 * x - 0.78 * z + 0.6 * bend) + 0.4)
    ridges = 0.0150 * (0.5 + 0.5 * long) ** 1.7 + 0.0080 * (0.5 + 0.5 * cross) ** 2.0 + 0.0016 * fine
    return THICKNESS + free * np.maximum(ridges + 0.001, 0.0)


def cloth_height(x: Shaped[F64, "*points"], z: Shaped[F64, "*points"]) -> Shaped[F64, "*points"]:
    """Height of the cloth above the table, zero outside the cloth."""
    local = np.stack([x, np.zeros_like(x), z], -1) - np.array(CLOTH_CENTER)
    local = local @ rotation_y(CLOTH_ANGLE_DEG)
    across, along = local[..., 0] / CLOTH_SIZE[0], local[..., 2] / CLOTH_SIZE[1]
    edge = 0.5 - np.maximum(np.abs(across), np.abs(along))
    hem = 0.25 + 0.75 * smoothstep(edge / 0.045)
    return np.where(edge >= 0, np.maximum(fold_height(x, z) * hem, THICKNESS * 0.6), 0.0)


def cloth(num_columns: int = 132, num_rows: int = 96) -> GridSurface:
    """Return the cloth as a one-sided sheet; one unit of the UV coordinates is 0.1 m."""
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, num_columns), np.linspace(-0.5, 0.5, num_rows))
    flat = np.stack([u * CLOTH_SIZE[0], 0 * u, v * CLOTH_SIZE[1]], -1) * (1 - 1e-9)
    points = flat @ rotation_y(CLOTH_ANGLE_DEG).T + np.array(CLOTH_CENTER)
    points[..., 1] = cloth_height(points[..., 0], points[..., 2])
    return grid_surface(points[::-1], (flat[..., [0, 2]] * 10)[::-1])


def stage(num_columns: int = 97, num_rows: int = 28) -> GridSurface:
    """Return the table: a round floor that rises into a wall behind the still life and stays flat toward the camera."""
    phi = np.linspace(0, 2 * np.pi, num_columns)[None, :]
    quarter = STAGE_CURVE * np.pi / 2
    end = STAGE_RADIUS + quarter + STAGE_HEIGHT - STAGE_CURVE
    inner, outer = np.linspace(1e-4, STAGE_RADIUS, 9)[:-1], np.linspace(STAGE_RADIUS, end, num_rows)
    s = np.concatenate([inner, outer])[:, None]
    # Along s: flat, then a quarter circle, then vertical. Azimuth 0 is +X; the wall's center is between +X and -Z.
    a = np.clip((s - STAGE_RADIUS) / STAGE_CURVE, 0, np.pi / 2)
    distance_past_edge = np.maximum(s - STAGE_RADIUS, 0)
    wall_weight = smoothstep((np.cos(phi + np.radians(55.0)) + 0.35) / 0.6)
    radius = (
        np.minimum(s, STAGE_RADIUS) + distance_past_edge * (1 - wall_weight) + STAGE_CURVE * np.sin(a) * wall_weight
    )
    y = (STAGE_CURVE * (1 - np.cos(a)) + np.maximum(distance_past_edge - quarter, 0)) * wall_weight
    points = np.stack([radius * np.cos(phi), y, radius * np.sin(phi)], -1)
    uvs = np.stack(np.broadcast_arrays(phi / (2 * np.pi), s), -1)
    return closed_grid_surface(points, uvs)
