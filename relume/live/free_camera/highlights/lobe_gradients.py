"""Gradients of non-environment highlights with respect to the mirror direction.

    Y(pixel) = Σ_probes w (Y_p + ½ G_p · (ωr − ω_p)),   G = ∂Y / ∂ωr

Y is the luminance of Σ_k w_k p_k t_k (`relume.live.free_camera.shade_probes`) for unit albedo, ωr the mirror direction
at the pixel. If the weights w reproduce ωr from those of probes, ω_p, this is exact for functions quadratic in ωr: the
full gradient adds twice the missing second order (docs/free-camera.md#highlights). ωr turns twice as fast as normals,
and so do reflections.

The contribution of a pixel is linear in its own ωr: probes provide G and G · ω_p.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import LUMINANCE
from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.basis.highlight_lobes import Lobes
from relume.live.free_camera.basis.material_tables import Tables
from relume.live.free_camera.basis.outgoing_coefficients import NUM_ROWS
from relume.live.free_camera.basis.table_index import (
    MIN_COSINE,
    powers_of_rotation,
    view_direction,
    view_direction_local,
)
from relume.math.zernike import DEGREE, num_rows, recurrence_by_degree
from relume.probes.stored_scene import ViewedProbes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_LUMINANCE = np.array(LUMINANCE, np.float32)
_NON_ENVIRONMENT_COLUMN = 4  # column of `Tables.table_index` for other light in highlights
_MIN_SINE = np.float32(1e-3)
_NUM_ROWS = np.array([num_rows(degree) for degree in range(DEGREE + 1)])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _sum_factors(tables, lobes, material, row, channel, num_basis, factors, step):  # type: ignore[no-untyped-def]
    """Sum the tables and albedos of a material's terms with a highlight.

    Args:
        tables, lobes: tables and lobes of all materials. material, row, channel: indices.
        num_basis: number of entries that the material needs.
        factors, step: written, w_k p_k in the row and the difference to the next. (entries,)
    Returns:
        The albedo in the row, and the difference to the next.
    """
    albedo = albedo_step = np.float32(0)
    lobe = lobes.lobe_index[material]
    for basis_index in range(num_basis):
        factors[basis_index] = step[basis_index] = 0
    for group in range(tables.table_index.shape[1]):
        table = tables.table_index[material, group, _NON_ENVIRONMENT_COLUMN]
        if table < 0:
            continue
        for basis_index in range(num_basis):
            factors[basis_index] += tables.isotropic[table, row, channel, basis_index]
            step[basis_index] += (
                tables.isotropic[table, row + 1, channel, basis_index]
                - tables.isotropic[table, row, channel, basis_index]
            )
        lower, upper = lobes.albedo[lobe, row, group, channel], lobes.albedo[lobe, row + 1, group, channel]
        albedo, albedo_step = albedo + lower, albedo_step + (upper - lower)
    return albedo, albedo_step


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _outgoing_with_derivatives(recurrence_table, incident, channel, num_basis, factors, step, fraction, rotation):  # type: ignore[no-untyped-def]
    """Sum the incident light of a probe with coefficients, and its derivatives.

    Args:
        recurrence_table: `recurrence_by_degree`. incident: t of the probe. (3, K).
        channel, num_basis, factors, step: see `_sum_factors`.
        fraction: toward the next row. rotation: from `powers_of_rotation`.
    Returns:
        Σ_k w_k p_k t_k; its derivative per row; and per radian of φo.
    """
    outgoing = row_derivative = azimuth_derivative = np.float32(0)
    for basis_index in range(num_basis):
        m = recurrence_table.order[basis_index]
        re, im = rotation[0, m], rotation[1, m]
        factor = factors[basis_index] + fraction * step[basis_index]
        light = incident[channel, recurrence_table.cosine[basis_index]]
        if m > 0:
            sine_light = incident[channel, recurrence_table.sine[basis_index]]
            azimuth_derivative += np.float32(m) * factor * (re * sine_light - im * light)
            light = re * light + im * sine_light
        outgoing += factor * light
        row_derivative += step[basis_index] * light
    return outgoing, row_derivative, azimuth_derivative


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _gradient(recurrence_table, frame, view_coordinates, non_environment, tables, lobes, material, scratch):  # type: ignore[no-untyped-def]
    """Return G of a probe, in world space.

    Args:
        frame: its normal, tangent and direction to the camera, unit, tuples. view_coordinates: from
            `view_direction_local`.
        non_environment: t of it. (3, K). scratch: (2, entries), (2, orders)
    """
    (n, t, o), (factors, step), rotation = frame, scratch[0], scratch[1]
    degree = tables.degree[material, _NON_ENVIRONMENT_COLUMN // 2]
    num_basis = _NUM_ROWS[degree]
    row, fraction, cosine_phi, sine_phi = view_coordinates
    facing = n[0] * o[0] + n[1] * o[1] + n[2] * o[2]
    cosine: Any = min(max(facing, MIN_COSINE), np.float32(1))
    sine: Any = max(math.sqrt(max(np.float32(1) - facing * facing, np.float32(0))), _MIN_SINE)
    # table rows per radian of θo; 0 beyond the end of the table
    rows_per_radian = np.float32(0.5 * (NUM_ROWS - 1)) * math.sqrt(np.float32(1) + cosine)
    if facing < MIN_COSINE:
        rows_per_radian = np.float32(0)
    powers_of_rotation(cosine_phi, sine_phi, degree, rotation)
    by_theta = by_phi = np.float32(0)
    for channel in range(3):
        albedo, albedo_step = _sum_factors(tables, lobes, material, row, channel, num_basis, factors, step)
        albedo += fraction * albedo_step
        outgoing, row_derivative, azimuth_derivative = _outgoing_with_derivatives(
            recurrence_table, non_environment, channel, num_basis, factors, step, fraction, rotation
        )
        if outgoing > 0 and albedo > np.float32(1e-6):
            weight = _LUMINANCE[channel] / albedo
            by_theta += weight * rows_per_radian * (row_derivative - outgoing * albedo_step / albedo)
            by_phi += weight * azimuth_derivative / sine
    # as θo grows, ωr turns down and away from the camera; as φo grows, against φ̂
    tangent_component = sine_phi * by_phi - facing * cosine_phi * by_theta
    bitangent_component, normal_component = -cosine_phi * by_phi - facing * sine_phi * by_theta, -sine * by_theta
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    return (
        tangent_component * t[0] + bitangent_component * bx + normal_component * n[0],
        tangent_component * t[1] + bitangent_component * by + normal_component * n[1],
        tangent_component * t[2] + bitangent_component * bz + normal_component * n[2],
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _gradients(recurrence_table, viewed, non_environment, tables, lobes, start, stop, scratch, out):  # type: ignore[no-untyped-def]
    """Compute G and G · ω_p of probes rows[start:stop]. scratch: (2, entries), (2, orders). out: (probes, 4)"""
    material, normal, tangent = viewed.material, viewed.points.normal, viewed.points.tangent
    for p in viewed.rows[start:stop]:
        out[p, 0] = out[p, 1] = out[p, 2] = out[p, 3] = 0
        has_table = False
        for group in range(tables.table_index.shape[1]):
            has_table |= tables.table_index[material[p], group, _NON_ENVIRONMENT_COLUMN] >= 0
        if lobes.lobe_index[material[p]] < 0 or not has_table:
            continue
        n, t = (normal[p, 0], normal[p, 1], normal[p, 2]), (tangent[p, 0], tangent[p, 1], tangent[p, 2])
        o = view_direction(viewed, p)
        gx, gy, gz = _gradient(
            recurrence_table, (n, t, o), view_direction_local(viewed, p), non_environment[p], tables, lobes,
            material[p], scratch,
        )  # fmt: skip
        twice = np.float32(2) * (n[0] * o[0] + n[1] * o[1] + n[2] * o[2])
        out[p, 0], out[p, 1], out[p, 2] = gx, gy, gz
        out[p, 3] = gx * (twice * n[0] - o[0]) + gy * (twice * n[1] - o[1]) + gz * (twice * n[2] - o[2])


def gradients_along_lobe(
    viewed: ViewedProbes,
    non_environment: Shaped[F32, "probes 3 K"],
    tables: Tables,
    lobes: Lobes,
    out: Shaped[F32, "probes 4"] | None = None,
) -> Shaped[F32, "probes 4"]:
    """Return the gradients of other light in highlights with respect to the mirror direction.

    Args:
        viewed: the probes to evaluate. non_environment: t of all light except the environment's own, of all probes.
        tables: of all materials; anisotropic ones are ignored. lobes: of all materials.
        out: overwritten there; None: new, zero elsewhere.
    Returns:
        G in world space, and G · ω_p, radiance.
    """
    gradients = np.zeros((len(non_environment), 4), np.float32) if out is None else out
    args = recurrence_by_degree(), viewed, non_environment, tables, lobes

    def compute(start: int, stop: int) -> None:
        scratch = np.empty((2, len(args[0].order)), np.float32), np.empty((2, DEGREE + 1), np.float32)
        _gradients(*args, start, stop, scratch, gradients)

    parallel_for_chunks(compute, len(viewed.rows))
    return gradients
