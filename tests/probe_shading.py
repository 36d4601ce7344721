"""Radiance that surface probes reflect, in plain NumPy: the reference of `shade_probes`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.live.free_camera.basis.highlight_lobes import NUM_GROUPS
from relume.live.free_camera.basis.material_tables import Tables
from relume.live.free_camera.basis.outgoing_coefficients import NUM_COLUMNS, NUM_ROWS
from relume.live.free_camera.basis.table_index import MIN_COSINE
from relume.math.zernike import NUM_FUNCTIONS, recurrence, recurrence_by_degree
from relume.probes.stored_scene import StoredScene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def rotate_coefficients(row: F64, phi: float) -> F64:
    """Rotate the coefficients of an isotropic term from φo = 0, (..., K), to another φo, like the kernels."""
    recurrence_table, out = recurrence(), np.array(row, np.float64)
    for basis_index, m in enumerate(recurrence_table.order):
        if m > 0:
            out[..., recurrence_table.sine[basis_index]] = row[..., recurrence_table.cosine[basis_index]] * np.sin(
                m * phi
            )
            out[..., recurrence_table.cosine[basis_index]] = row[..., recurrence_table.cosine[basis_index]] * np.cos(
                m * phi
            )
    return out


def shade_probes_numpy(
    stored_scene: StoredScene, vectors: F32, non_environment: F32, tables: Tables, camera_position: F32, probe: int
) -> tuple[F64, F64]:
    """Reference of `shade_probes` for one probe in plain NumPy.

    Args:
        stored_scene, vectors, non_environment, tables, camera_position: as there. probe: its index.
    Returns:
        Radiance and environment light, as there. (groups, 3) float64 each
    """
    lights = vectors[probe], vectors[probe] - non_environment[probe], non_environment[probe]
    plain, environment, highlights = (
        _sum_numpy(stored_scene, t, tables, camera_position, probe, 2 * kind) for kind, t in enumerate(lights)
    )
    return plain + np.maximum(highlights, 0), environment


def _sum_numpy(
    stored_scene: StoredScene, light: F32, tables: Tables, camera_position: F32, probe: int, first: int
) -> F64:
    """Sum the light (3, K) of a probe with the tables of a kind, which begin at column `first`. (groups, 3)"""
    probes, recurrence_table = stored_scene.probes, recurrence_by_degree()
    n, t = probes.normal[probe].astype(np.float64), probes.tangent[probe].astype(np.float64)
    wo = camera_position.astype(np.float64) - probes.position[probe]
    x, y, z = np.array([t, np.cross(n, t), n]) @ wo / np.linalg.norm(wo)
    row_coordinate = np.sqrt(1 - np.clip(z, MIN_COSINE, 1)) * (NUM_ROWS - 1)
    row, phi = min(int(row_coordinate), NUM_ROWS - 2), np.arctan2(y, x)
    row_fraction, column_coordinate = row_coordinate - row, phi / (2 * np.pi) % 1 * NUM_COLUMNS
    column_index = int(column_coordinate) % NUM_COLUMNS
    out = np.zeros((NUM_GROUPS, 3))
    for group, (isotropic, anisotropic) in enumerate(
        tables.table_index[stored_scene.material[probe], :, first : first + 2]
    ):
        factors = np.zeros((3, NUM_FUNCTIONS))
        if isotropic >= 0:
            unrotated = np.zeros((3, NUM_FUNCTIONS))
            unrotated[:, recurrence_table.cosine] = (1 - row_fraction) * tables.isotropic[
                isotropic, row
            ] + row_fraction * tables.isotropic[isotropic, row + 1]
            factors += rotate_coefficients(unrotated, phi)
        if anisotropic >= 0:
            row_pair = tables.anisotropic[anisotropic, row : row + 2]
            interpolated = row_pair[:, column_index] + (column_coordinate - int(column_coordinate)) * (
                row_pair[:, (column_index + 1) % NUM_COLUMNS] - row_pair[:, column_index]
            )
            factors += (1 - row_fraction) * interpolated[0] + row_fraction * interpolated[1]
        out[group] = np.einsum("ck,ck->c", factors, light.astype(np.float64))
    return out
