"""Radiance that surface probes reflect toward the camera: B(x, ωo) = Σ_k p_k(ωo) t_k(x).

Highlights of the environment are shaded apart (`relume.live.free_camera.highlights.interpolated_highlights`). Other
light is Σ_k w_k p_k t_k: the window w_k suppresses the ringing of the truncated basis, which is negative beside bright
light, at the cost of a slight blur (docs/free-camera.md#highlights).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.basis.highlight_lobes import NUM_GROUPS
from relume.live.free_camera.basis.material_tables import Tables
from relume.live.free_camera.basis.outgoing_coefficients import NUM_COLUMNS
from relume.live.free_camera.basis.table_index import powers_of_rotation, view_direction_local
from relume.math.zernike import DEGREE, num_functions, num_rows, recurrence_by_degree
from relume.probes.stored_scene import ViewedProbes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NUM_ROWS = np.array([num_rows(degree) for degree in range(DEGREE + 1)])
_NUM_FUNCTIONS = np.array([num_functions(degree) for degree in range(DEGREE + 1)])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _shade_probes(recurrence_table, viewed, vectors, non_environment, tables, start, stop, scratch, out):  # type: ignore[no-untyped-def]
    """Shade probes rows[start:stop].

    Args:
        recurrence_table: `recurrence_by_degree`. viewed, vectors, non_environment, tables: of `shade_probes`.
        scratch: (3, entries), (2, orders), (groups, 3). out: `ProbeRadiance`, written.
    """
    material, (radiance, environment), (rotated_light, rotation, outgoing) = viewed.material, out, scratch
    num_groups = outgoing.shape[0]
    for p in viewed.rows[start:stop]:
        view_coordinates = row, fraction, cosine_phi, sine_phi = view_direction_local(viewed, p)
        for group in range(num_groups):
            for channel in range(3):
                radiance[p, group, channel] = environment[p, group, channel] = 0
        for kind in range(0, 6 if non_environment.shape[0] > 0 else 2, 2):
            degree = tables.degree[material[p], kind // 2]
            if degree < 0:
                continue
            is_isotropic = is_anisotropic = False
            for group in range(num_groups):
                outgoing[group, 0] = outgoing[group, 1] = outgoing[group, 2] = 0
                is_isotropic |= tables.table_index[material[p], group, kind] >= 0
                is_anisotropic |= tables.table_index[material[p], group, kind + 1] >= 0
            if is_isotropic:
                num_basis = _NUM_ROWS[degree]
                powers_of_rotation(cosine_phi, sine_phi, degree, rotation)
                for basis_index in range(num_basis):
                    m = recurrence_table.order[basis_index]
                    cosine, sine = recurrence_table.cosine[basis_index], recurrence_table.sine[basis_index]
                    for channel in range(3):
                        cosine_light = sine_light = np.float32(0)
                        if kind < 4:
                            cosine_light, sine_light = vectors[p, channel, cosine], vectors[p, channel, sine]
                        if kind == 2:
                            cosine_light, sine_light = (
                                cosine_light - non_environment[p, channel, cosine],
                                sine_light - non_environment[p, channel, sine],
                            )
                        elif kind == 4:
                            cosine_light, sine_light = (
                                non_environment[p, channel, cosine],
                                non_environment[p, channel, sine],
                            )
                        rotated_light[channel, basis_index] = (
                            rotation[0, m] * cosine_light + rotation[1, m] * sine_light if m > 0 else cosine_light
                        )
                for group in range(num_groups):
                    table = tables.table_index[material[p], group, kind]
                    if table < 0:
                        continue
                    for channel in range(3):
                        lower, upper = tables.isotropic[table, row, channel], tables.isotropic[table, row + 1, channel]
                        total = np.float32(0)
                        for basis_index in range(num_basis):
                            total += (
                                lower[basis_index] + fraction * (upper[basis_index] - lower[basis_index])
                            ) * rotated_light[channel, basis_index]
                        outgoing[group, channel] = total
            if is_anisotropic:  # a function of its own: with its loop here, the one above is four times slower
                num_basis, light = _NUM_FUNCTIONS[degree], (vectors[p], non_environment)
                _add_anisotropic(tables, material[p], kind, num_basis, view_coordinates, light, p, outgoing)
            for group in range(num_groups):
                for channel in range(3):
                    if kind == 0:
                        radiance[p, group, channel] = outgoing[group, channel]
                    elif kind == 2:
                        environment[p, group, channel] = outgoing[group, channel]
                    else:  # clamped: negative ringing would darken the environment's highlight
                        radiance[p, group, channel] += max(outgoing[group, channel], np.float32(0))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_anisotropic(tables, material, kind, num_basis, view_coordinates, lights, p, out):  # type: ignore[no-untyped-def]
    """Add the products of probe p's coefficients with tables over θo and φo. out: (groups, 3)"""
    (row, fraction, cosine_phi, sine_phi), (vectors, non_environment) = view_coordinates, lights
    azimuth = math.atan2(sine_phi, cosine_phi) / (np.float32(2) * np.float32(math.pi))
    column_coordinate = (azimuth - math.floor(azimuth)) * np.float32(NUM_COLUMNS)
    column: Any = min(np.int64(column_coordinate), NUM_COLUMNS - 1)
    next_column, column_fraction = (column + 1) % NUM_COLUMNS, np.float32(column_coordinate - column)
    for group in range(out.shape[0]):
        if tables.table_index[material, group, kind + 1] < 0:
            continue
        table = tables.anisotropic[tables.table_index[material, group, kind + 1]]
        for channel in range(3):
            total = np.float32(0)
            for k in range(num_basis):
                lower = table[row, column, channel, k]
                lower += column_fraction * (table[row, next_column, channel, k] - lower)
                upper = table[row + 1, column, channel, k]
                upper += column_fraction * (table[row + 1, next_column, channel, k] - upper)
                light = vectors[channel, k] if kind < 4 else non_environment[p, channel, k]
                if kind == 2:
                    light -= non_environment[p, channel, k]
                total += (lower + fraction * (upper - lower)) * light
            out[group, channel] += total


class ProbeRadiance(NamedTuple):
    """Radiance reflected by probes, by groups of terms as in `Tables`.

    Attributes:
        radiance: without highlights of the environment. environment: those highlights, as far as the basis represents
            them.
    """

    radiance: Shaped[F32, "probes groups 3"]
    environment: Shaped[F32, "probes groups 3"]


def shade_probes(
    viewed: ViewedProbes,
    vectors: Shaped[F32, "probes 3 functions"],
    non_environment: Shaped[F32, "probes 3 functions"] | None,
    tables: Tables,
    out: ProbeRadiance | None = None,
) -> ProbeRadiance:
    """Compute the radiance that probes reflect toward the camera.

    Args:
        viewed: the probes to shade. vectors: incident radiance coefficients t of all probes.
        non_environment: t of all light except the environment itself, for terms with a highlight; None: it is zero.
        tables: outgoing coefficients of all materials.
        out: written for these; None: new, zero elsewhere.
    """
    shape = len(vectors), NUM_GROUPS, 3
    outgoing = ProbeRadiance(np.zeros(shape, np.float32), np.zeros(shape, np.float32)) if out is None else out
    table = recurrence_by_degree()
    other = np.empty((0, *vectors.shape[1:]), np.float32) if non_environment is None else non_environment
    args = table, viewed, vectors, other, tables

    def shade(start: int, stop: int) -> None:
        shapes = (3, len(table.order)), (2, DEGREE + 1), (NUM_GROUPS, 3)
        scratch = tuple(np.empty(scratch_shape, np.float32) for scratch_shape in shapes)
        _shade_probes(*args, start, stop, scratch, outgoing)

    parallel_for_chunks(shade, len(viewed.rows))
    return outgoing
