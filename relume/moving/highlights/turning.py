"""How other light than the sky's changes in highlights as they look elsewhere: gradients, and halves of them.

    Y(pixel) = Σ_points w (Y_p + ½ G_p · (ωr − ω_p)),   G = ∂Y / ∂ωr

Y is the luminance of Σ_k w_k p_k t_k (`relume.moving.evaluate`) for an albedo of one, ωr the mirror direction of what
is seen. Where weights w give ωr back from those of points, ω_p, this is exact for what is square in ωr: the second
order that the whole gradient adds too much of is what is missing without it (docs/adr/0112-half-gradients.md). ωr turns
twice as fast as normals do, and reflections with it.

What pixels add is linear in their own ωr: points tell G, and G · ω_p.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import ladder
from relume.color import LUMINANCE
from relume.moving.basis.lobes import Lobes
from relume.moving.basis.out_factors import NUM_ROWS
from relume.moving.basis.rows import LEAST_COSINE, seen_from
from relume.moving.basis.tables import Tables
from relume.moving.evaluate import send_numpy
from relume.moving.points.surface import Surface
from relume.parallel import for_shares
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_LUMINANCE = np.array(LUMINANCE, np.float32)
_BESIDE = 4  # the column of `Tables.of` for other light in highlights
_LEAST_SINE = np.float32(1e-3)
_ASIDE = 1e-5  # radians


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _factors_into(tables, lobes, material, row, channel, near, step):  # type: ignore[no-untyped-def]
    """Sum the tables and albedos of a material's terms with a highlight.

    Args:
        tables, lobes: of all materials. material, row, channel: which one, and where.
        near, step: written, w_k p_k in the row and what the next has more. (rungs,)
    Returns:
        The albedo in the row, and what the next has more.
    """
    albedo = albedo_step = np.float32(0)
    lobe, num_rungs = lobes.of[material], near.shape[0]
    for rung in range(num_rungs):
        near[rung] = step[rung] = 0
    for group in range(tables.of.shape[1]):
        table = tables.of[material, group, _BESIDE]
        if table < 0:
            continue
        for rung in range(num_rungs):
            near[rung] += tables.even[table, row, channel, rung]
            step[rung] += tables.even[table, row + 1, channel, rung] - tables.even[table, row, channel, rung]
        here, there = lobes.albedo[lobe, row, group, channel], lobes.albedo[lobe, row + 1, group, channel]
        albedo, albedo_step = albedo + here, albedo_step + (there - here)
    return albedo, albedo_step


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _sum(rungs, light_of, channel, near, step, seen):  # type: ignore[no-untyped-def]
    """Sum the light of a point with factors, and how that changes.

    Args:
        rungs: of the ladder. light_of: t of the point. (3, K). channel, near, step: see `_factors_into`.
        seen: from `seen_from`.
    Returns:
        Σ_k w_k p_k t_k; what it changes by in a row; and in a radian of φo.
    """
    _, share, cosine_phi, sine_phi = seen
    sent = of_row = of_turn = np.float32(0)
    re, im = np.float32(1), np.float32(0)
    for rung in range(near.shape[0]):
        m = rungs.order[rung]
        if rungs.a[rung] == 0 and m > 0:
            re, im = re * cosine_phi - im * sine_phi, re * sine_phi + im * cosine_phi
        factor = near[rung] + share * step[rung]
        light = light_of[channel, rungs.cosine[rung]]
        if m > 0:
            other = light_of[channel, rungs.sine[rung]]
            of_turn += np.float32(m) * factor * (re * other - im * light)
            light = re * light + im * other
        sent += factor * light
        of_row += step[rung] * light
    return sent, of_row, of_turn


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _turn_of(rungs, n, t, o, seen, others, tables, lobes, material, near, step):  # type: ignore[no-untyped-def]
    """Find G of a point, in world space.

    Args:
        n, t, o: its normal, its tangent and where the eye is, unit, tuples. seen: from `seen_from`.
        others: t of it. (3, K). near, step: room. (rungs,)
    """
    row, share, cosine_phi, sine_phi = seen
    facing = n[0] * o[0] + n[1] * o[1] + n[2] * o[2]
    cosine: Any = min(max(facing, LEAST_COSINE), np.float32(1))
    sine: Any = max(math.sqrt(max(np.float32(1) - facing * facing, np.float32(0))), _LEAST_SINE)
    # rows of tables for a radian of θo; none where tables end
    rows_a_radian = np.float32(0.5 * (NUM_ROWS - 1)) * math.sqrt(np.float32(1) + cosine)
    if facing < LEAST_COSINE:
        rows_a_radian = np.float32(0)
    by_theta = by_phi = np.float32(0)
    for channel in range(3):
        albedo, albedo_step = _factors_into(tables, lobes, material, row, channel, near, step)
        albedo += share * albedo_step
        sent, of_row, of_turn = _sum(rungs, others, channel, near, step, seen)
        if sent > 0 and albedo > np.float32(1e-6):
            weight = _LUMINANCE[channel] / albedo
            by_theta += weight * rows_a_radian * (of_row - sent * albedo_step / albedo)
            by_phi += weight * of_turn / sine
    # ωr goes down where θo grows, away from the eye, and turns against φ̂
    of_t = sine_phi * by_phi - facing * cosine_phi * by_theta
    of_b, of_n = -cosine_phi * by_phi - facing * sine_phi * by_theta, -sine * by_theta
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    return (
        of_t * t[0] + of_b * bx + of_n * n[0],
        of_t * t[1] + of_b * by + of_n * n[1],
        of_t * t[2] + of_b * bz + of_n * n[2],
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _turn_rows(rungs, points, material, others, tables, lobes, eye, rows, start, stop, near, step, out):  # type: ignore[no-untyped-def]
    """Find G and G · ω_p of the points that are [start, stop) of rows. out: (points, 4), written there"""
    position, normal, tangent, _, _ = points
    for at in range(start, stop):
        p = rows[at]
        out[p, 0] = out[p, 1] = out[p, 2] = out[p, 3] = 0
        is_asked = False
        for group in range(tables.of.shape[1]):
            is_asked |= tables.of[material[p], group, _BESIDE] >= 0
        if lobes.of[material[p]] < 0 or not is_asked:
            continue
        n, t = (normal[p, 0], normal[p, 1], normal[p, 2]), (tangent[p, 0], tangent[p, 1], tangent[p, 2])
        x, y, z = eye[0] - position[p, 0], eye[1] - position[p, 1], eye[2] - position[p, 2]
        per = np.float32(1) / math.sqrt(max(x * x + y * y + z * z, np.float32(1e-20)))
        o = per * x, per * y, per * z
        seen = seen_from(position[p], normal[p], tangent[p], eye)
        gx, gy, gz = _turn_of(rungs, n, t, o, seen, others[p], tables, lobes, material[p], near, step)
        twice = np.float32(2) * (n[0] * o[0] + n[1] * o[1] + n[2] * o[2])
        out[p, 0], out[p, 1], out[p, 2] = gx, gy, gz
        out[p, 3] = gx * (twice * n[0] - o[0]) + gy * (twice * n[1] - o[1]) + gz * (twice * n[2] - o[2])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _turn(rungs, points, material, others, tables, lobes, eye, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Make room, and do as `_turn_rows`."""
    near, step = np.empty(rungs.order.shape[0], np.float32), np.empty(rungs.order.shape[0], np.float32)
    _turn_rows(rungs, points, material, others, tables, lobes, eye, rows, start, stop, near, step, out)


def turning(
    surface: Surface,
    others: F32,
    tables: Tables,
    lobes: Lobes,
    eye: F32,
    is_needed: NDArray[np.uint8],
    out: F32 | None = None,
) -> F32:
    """Find how points send other light otherwise in their highlights as these look elsewhere.

    Args:
        surface: whose points. others: t of all light but the sky's own. (points, 3, K) float32
        tables: of all materials; those over φo too tell nothing of it. lobes: of all materials.
        eye: where it is. (3,) float32
        is_needed: points that are asked. (points,) uint8
        out: written where needed; None: the others are nothing.
    Returns:
        G, world space, and G · ω_p, radiance. (points, 4) float32
    """
    found = np.zeros((len(others), 4), np.float32) if out is None else out
    rows = np.flatnonzero(is_needed.view(np.bool_))
    of_points = ladder(), surface.points, surface.material, others
    args = *of_points, tables, lobes, np.ascontiguousarray(eye, np.float32), rows
    for_shares(lambda start, stop: _turn(*args, start, stop, found), len(rows))
    return found


def turning_numpy(surface: Surface, others: F32, tables: Tables, lobes: Lobes, eye: F32, point: int) -> F64:
    """Do as `turning` for one point, by how `send_numpy` differs a little aside of the eye: its oracle.

    Args:
        surface, others, tables, lobes, eye: as there. point: number of the point, which has a lobe.
    Returns:
        (4,) float64
    """
    n, place = (array[point].astype(np.float64) for array in (surface.points.normal, surface.points.position))
    away, lobe = eye - place, lobes.of[surface.material[point]]
    distance, aside = float(np.linalg.norm(away)), np.linalg.svd(away[None])[2][1:]

    def luminous(towards: F64) -> float:
        sent, _ = send_numpy(surface, np.zeros_like(others), others, tables, place + distance * towards, point)
        rows = np.sqrt(1 - np.clip(towards @ n, LEAST_COSINE, 1)) * (NUM_ROWS - 1)
        of_rows = lobes.albedo[lobe].sum(axis=1).astype(np.float64)
        albedo = [np.interp(rows, np.arange(NUM_ROWS), of_rows[:, channel]) for channel in range(3)]
        return float(sent.sum(axis=0) / np.maximum(albedo, 1e-30) @ LUMINANCE)

    wo, gradient = away / distance, np.zeros(3)
    for across in aside:
        here, there = (wo + sign * _ASIDE * across for sign in (1, -1))
        change = luminous(here / np.linalg.norm(here)) - luminous(there / np.linalg.norm(there))
        gradient += change / (2 * _ASIDE) * (2 * (n @ across) * n - across)
    return np.append(gradient, gradient @ (2 * (n @ wo) * n - wo))
