"""What points send to an eye: B(x, ωo) = Σ_k p_k(ωo) t_k(x), for the points that a picture needs.

What has a highlight sends the sky apart from other light (`relume.moving.highlights.between_points`). Of other light it
sends Σ_k w_k p_k t_k: functions cut off at a degree ring, black beside what is bright, which w takes away for a
little blur (docs/adr/0063-highlights.md).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import NUM_FUNCTIONS, ladder
from relume.moving.basis.lobes import NUM_GROUPS
from relume.moving.basis.out_factors import NUM_COLUMNS, NUM_ROWS, turned
from relume.moving.basis.rows import LEAST_COSINE, seen_from
from relume.moving.basis.tables import Tables
from relume.moving.points.surface import Surface
from relume.parallel import for_shares
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


# In one piece: arrays that are handed to functions, even to inlined ones, are counted as references, at every point.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _send(rungs, points, material, vectors, others, tables, eye, rows, start, stop, out, sky):  # type: ignore[no-untyped-def]
    """Evaluate the points that are [start, stop) of rows. out, sky: (points, groups, 3), written there"""
    position, normal, tangent, _, _ = points
    num_groups, num_rungs = out.shape[1], rungs.order.shape[0]
    turned_light, sent = np.empty((3, num_rungs), np.float32), np.empty((num_groups, 3), np.float32)
    for p in rows[start:stop]:
        row, share, cosine_phi, sine_phi = seen_from(position[p], normal[p], tangent[p], eye)
        for group in range(num_groups):
            for channel in range(3):
                out[p, group, channel] = sky[p, group, channel] = 0
        for kind in range(0, 6 if others.shape[0] > 0 else 2, 2):
            is_even = is_uneven = False
            for group in range(num_groups):
                sent[group, 0] = sent[group, 1] = sent[group, 2] = 0
                is_even |= tables.of[material[p], group, kind] >= 0
                is_uneven |= tables.of[material[p], group, kind + 1] >= 0
            if is_even:
                re, im = np.float32(1), np.float32(0)
                for rung in range(num_rungs):
                    m = rungs.order[rung]
                    if rungs.a[rung] == 0 and m > 0:
                        re, im = re * cosine_phi - im * sine_phi, re * sine_phi + im * cosine_phi
                    cosine, sine = rungs.cosine[rung], rungs.sine[rung]
                    for channel in range(3):
                        along = across = np.float32(0)
                        if kind < 4:
                            along, across = vectors[p, channel, cosine], vectors[p, channel, sine]
                        if kind == 2:
                            along, across = along - others[p, channel, cosine], across - others[p, channel, sine]
                        elif kind == 4:
                            along, across = others[p, channel, cosine], others[p, channel, sine]
                        turned_light[channel, rung] = re * along + im * across if m > 0 else re * along
                for group in range(num_groups):
                    table = tables.of[material[p], group, kind]
                    if table < 0:
                        continue
                    for channel in range(3):
                        near, far = tables.even[table, row, channel], tables.even[table, row + 1, channel]
                        total = np.float32(0)
                        for rung in range(num_rungs):
                            total += (near[rung] + share * (far[rung] - near[rung])) * turned_light[channel, rung]
                        sent[group, channel] = total
            if is_uneven:  # apart: beside its loop the one above is four times slower
                seen = row, share, cosine_phi, sine_phi
                _add_uneven(tables.uneven, tables.of, material[p], kind, seen, vectors, others, p, sent)
            for group in range(num_groups):
                for channel in range(3):
                    if kind == 0:
                        out[p, group, channel] = sent[group, channel]
                    elif kind == 2:
                        sky[p, group, channel] = sent[group, channel]
                    else:  # what rings below black would take from the sky beside it
                        out[p, group, channel] += max(sent[group, channel], np.float32(0))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _add_uneven(tables, of, material, kind, seen, vectors, others, p, out):  # type: ignore[no-untyped-def]
    """Add sums of the light vector of point p with tables over θo and φo. out: (groups, 3)"""
    row, share, cosine_phi, sine_phi = seen
    turned_by = math.atan2(sine_phi, cosine_phi) / (np.float32(2) * np.float32(math.pi))
    place = (turned_by - math.floor(turned_by)) * np.float32(NUM_COLUMNS)
    column: Any = min(np.int64(place), NUM_COLUMNS - 1)
    beside, part = (column + 1) % NUM_COLUMNS, np.float32(place - column)
    for group in range(out.shape[0]):
        if of[material, group, kind + 1] < 0:
            continue
        table = tables[of[material, group, kind + 1]]
        for channel in range(3):
            total = np.float32(0)
            for k in range(vectors.shape[2]):
                near = table[row, column, channel, k]
                near += part * (table[row, beside, channel, k] - near)
                far = table[row + 1, column, channel, k]
                far += part * (table[row + 1, beside, channel, k] - far)
                light = vectors[p, channel, k] if kind < 4 else others[p, channel, k]
                if kind == 2:
                    light -= others[p, channel, k]
                total += (near + share * (far - near)) * light
            out[group, channel] += total


class Sent(NamedTuple):
    """What points send, by groups of terms as in `Tables`.

    Attributes:
        radiance: without the sky in highlights. (points, groups, 3) float32
        sky: in highlights, as far as the in-basis tells it. (points, groups, 3) float32
    """

    radiance: F32
    sky: F32


def send(
    surface: Surface,
    vectors: F32,
    others: F32 | None,
    tables: Tables,
    eye: F32,
    is_needed: NDArray[np.uint8],
    out: Sent | None = None,
) -> Sent:
    """Find what points send to an eye.

    Args:
        surface: whose points. vectors: t of each. (points, 3, K) float32
        others: t of all light but the sky's own, for terms with a highlight; None: they send nothing.
        tables: of all materials. eye: where it is. (3,) float32
        is_needed: points that are evaluated. (points,) uint8
        out: written where needed; None: the others are black.
    """
    shape = len(vectors), NUM_GROUPS, 3
    found = Sent(np.zeros(shape, np.float32), np.zeros(shape, np.float32)) if out is None else out
    rows = np.flatnonzero(is_needed.view(np.bool_))
    args = (
        ladder(),
        surface.points,
        surface.material,
        vectors,
        np.empty((0, *vectors.shape[1:]), np.float32) if others is None else others,
        tables,
        np.ascontiguousarray(eye, np.float32),
        rows,
    )
    for_shares(lambda start, stop: _send(*args, start, stop, *found), len(rows))
    return found


def send_numpy(surface: Surface, vectors: F32, others: F32, tables: Tables, eye: F32, point: int) -> tuple[F64, F64]:
    """Do as `send` for one point, in plain NumPy: its oracle.

    Args:
        surface, vectors, others, tables, eye: as there. point: number of the point.
    Returns:
        Radiance and sky, as there. (groups, 3) float64 each
    """
    lights = vectors[point], vectors[point] - others[point], others[point]
    plain, sky, highlights = (_sum_numpy(surface, t, tables, eye, point, 2 * kind) for kind, t in enumerate(lights))
    return plain + np.maximum(highlights, 0), sky


def _sum_numpy(surface: Surface, light: F32, tables: Tables, eye: F32, point: int, first: int) -> F64:
    """Sum the light (3, K) of a point with the tables of a kind, which begin at column `first`. (groups, 3)"""
    points, rungs = surface.points, ladder()
    n, t = points.normal[point].astype(np.float64), points.tangent[point].astype(np.float64)
    wo = eye.astype(np.float64) - points.position[point]
    x, y, z = np.array([t, np.cross(n, t), n]) @ wo / np.linalg.norm(wo)
    place = np.sqrt(1 - np.clip(z, LEAST_COSINE, 1)) * (NUM_ROWS - 1)
    row, phi = min(int(place), NUM_ROWS - 2), np.arctan2(y, x)
    share, column = place - row, phi / (2 * np.pi) % 1 * NUM_COLUMNS
    left = int(column) % NUM_COLUMNS
    out = np.zeros((NUM_GROUPS, 3))
    for group, (even, uneven) in enumerate(tables.of[surface.material[point], :, first : first + 2]):
        factors = np.zeros((3, NUM_FUNCTIONS))
        if even >= 0:
            plain = np.zeros((3, NUM_FUNCTIONS))
            plain[:, rungs.cosine] = (1 - share) * tables.even[even, row] + share * tables.even[even, row + 1]
            factors += turned(plain, phi)
        if uneven >= 0:
            two = tables.uneven[uneven, row : row + 2]
            between = two[:, left] + (column - int(column)) * (two[:, (left + 1) % NUM_COLUMNS] - two[:, left])
            factors += (1 - share) * between[0] + share * between[1]
        out[group] = np.einsum("ck,ck->c", factors, light.astype(np.float64))
    return out
