"""What points send to an eye: B(x, ωo) = Σ_k p_k(ωo) t_k(x), for the points that a picture needs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import NUM_FUNCTIONS, ladder
from relume.brdf.albedo import TEXTURES
from relume.moving.basis.lobes import NUM_GROUPS, is_narrow
from relume.moving.basis.out_factors import NUM_COLUMNS, NUM_ROWS, out_factors, turned
from relume.moving.glints import LEAST_COSINE, row_of
from relume.moving.points.surface import Surface
from relume.parallel import for_shares

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class Tables(NamedTuple):
    """The out-factors of all materials.

    Attributes:
        even: of isotropic terms summed, for φo = 0, by rungs of the ladder. (tables, `NUM_ROWS`, 3, rungs) float32
        uneven: of the others summed. (tables, `NUM_ROWS`, `NUM_COLUMNS`, 3, K) float32
        of: table of each material and group in both, −1 for none; groups are terms without a texture, and those that
            each of `TEXTURES` multiplies. (materials, groups, 2) int32
    """

    even: F32
    uneven: F32
    of: NDArray[np.int32]

    @classmethod
    def joined(cls, parts: Sequence[Tables]) -> Self:
        """Those of some materials, then of others."""
        even, uneven = (np.concatenate([part[kind] for part in parts]) for kind in (0, 1))
        num = np.array([[len(part.even), len(part.uneven)] for part in parts], np.int32)
        first = np.repeat(np.cumsum(num, axis=0, dtype=np.int32) - num, [len(part.of) for part in parts], axis=0)
        of = np.concatenate([part.of for part in parts])
        return cls(even, uneven, np.where(of >= 0, of + first[:, None], of))


def tables_of(materials: Sequence[Sequence[Mapping[str, Any]]]) -> Tables:
    """Sum the out-factors of the broad terms of each material that the same texture multiplies.

    Args:
        materials: the terms of each, of a complete look.
    """
    rungs = ladder()
    even: list[F32] = []
    uneven: list[F32] = []
    of = np.full((len(materials), NUM_GROUPS, 2), -1, np.int32)
    for index, terms in enumerate(materials):
        for group in range(NUM_GROUPS):
            texture = None if group == 0 else TEXTURES[group - 1]
            broad = (term for term in terms if term.get("texture") == texture and not is_narrow(term))
            found = [out_factors(term).table for term in broad]
            for kind, kept, tables in (
                (0, even, [t[:, 0][..., rungs.cosine] for t in found if t.shape[1] == 1]),
                (1, uneven, [t for t in found if t.shape[1] > 1]),
            ):
                if tables:
                    of[index, group, kind] = len(kept)
                    kept.append(np.sum(tables, axis=0, dtype=np.float32))
    return Tables(
        np.stack(even) if even else np.empty((0, NUM_ROWS, 3, len(rungs.order)), np.float32),
        np.stack(uneven) if uneven else np.empty((0, NUM_ROWS, NUM_COLUMNS, 3, NUM_FUNCTIONS), np.float32),
        of,
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _send(rungs, points, material, vectors, tables, eye, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Evaluate the points that are [start, stop) of rows. out: (points, groups, 3), written there"""
    position, normal, tangent, _ = points
    num_rungs = rungs.order.shape[0]
    turned_light = np.empty((3, num_rungs), np.float32)
    for p in rows[start:stop]:
        row, share, cosine_phi, sine_phi = _seen_from(position[p], normal[p], tangent[p], eye)
        re, im = np.float32(1), np.float32(0)
        for rung in range(num_rungs):
            m = rungs.order[rung]
            if rungs.a[rung] == 0 and m > 0:
                re, im = re * cosine_phi - im * sine_phi, re * sine_phi + im * cosine_phi
            cosine, sine = rungs.cosine[rung], rungs.sine[rung]
            for channel in range(3):
                value = re * vectors[p, channel, cosine]
                if m > 0:
                    value += im * vectors[p, channel, sine]
                turned_light[channel, rung] = value
        for group in range(out.shape[1]):
            even, uneven = tables.of[material[p], group, 0], tables.of[material[p], group, 1]
            for channel in range(3):
                total = np.float32(0)
                if even >= 0:
                    near, far = tables.even[even, row, channel], tables.even[even, row + 1, channel]
                    for rung in range(num_rungs):
                        total += (near[rung] + share * (far[rung] - near[rung])) * turned_light[channel, rung]
                if uneven >= 0:
                    total += _uneven(
                        tables.uneven[uneven], row, share, cosine_phi, sine_phi, channel, vectors[p, channel]
                    )
                out[p, group, channel] = total


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _seen_from(position, normal, tangent, eye):  # type: ignore[no-untyped-def]
    """Find where a point's wo lies in tables: a row, the share of the next, and cos φo, sin φo."""
    x, y, z = eye[0] - position[0], eye[1] - position[1], eye[2] - position[2]
    scale = np.float32(1) / math.sqrt(max(x * x + y * y + z * z, np.float32(1e-20)))
    x, y, z = scale * x, scale * y, scale * z
    n, t = normal, tangent
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    across, along = t[0] * x + t[1] * y + t[2] * z, bx * x + by * y + bz * z
    cosine: Any = min(max(n[0] * x + n[1] * y + n[2] * z, LEAST_COSINE), np.float32(1))
    length = math.sqrt(across * across + along * along)
    row, share = row_of(cosine)
    if length < np.float32(1e-6):
        return row, share, np.float32(1), np.float32(0)
    return row, share, np.float32(across / length), np.float32(along / length)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _uneven(table, row, share, cosine_phi, sine_phi, channel, vector):  # type: ignore[no-untyped-def]
    """Sum a vector (K,) with a table over θo and φo."""
    turn = math.atan2(sine_phi, cosine_phi) / (np.float32(2) * np.float32(math.pi))
    place = (turn - math.floor(turn)) * np.float32(NUM_COLUMNS)
    column: Any = min(np.int64(place), NUM_COLUMNS - 1)
    beside, part = (column + 1) % NUM_COLUMNS, np.float32(place - column)
    total = np.float32(0)
    for k in range(vector.shape[0]):
        near = table[row, column, channel, k] + part * (table[row, beside, channel, k] - table[row, column, channel, k])
        far = table[row + 1, column, channel, k] + part * (
            table[row + 1, beside, channel, k] - table[row + 1, column, channel, k]
        )
        total += (near + share * (far - near)) * vector[k]
    return total


def send(
    surface: Surface,
    vectors: F32,
    tables: Tables,
    eye: F32,
    is_needed: NDArray[np.uint8],
    out: F32 | None = None,
) -> F32:
    """Find what points send to an eye.

    Args:
        surface: whose points. vectors: t of each. (points, 3, K) float32
        tables: of all materials. eye: where it is. (3,) float32
        is_needed: points that are evaluated. (points,) uint8
        out: written where needed; None: the others are black.
    Returns:
        Radiance, by groups of terms as in `Tables`. (points, groups, 3) float32
    """
    found = np.zeros((len(vectors), NUM_GROUPS, 3), np.float32) if out is None else out
    rows = np.flatnonzero(is_needed.view(np.bool_))
    args = (
        ladder(),
        surface.points,
        surface.material,
        vectors,
        tables,
        np.ascontiguousarray(eye, np.float32),
        rows,
    )
    for_shares(lambda start, stop: _send(*args, start, stop, found), len(rows))
    return found


def send_numpy(surface: Surface, vectors: F32, tables: Tables, eye: F32, point: int) -> F64:
    """Do as `send` for one point, in plain NumPy: its oracle.

    Args:
        surface, vectors, tables, eye: as there. point: number of the point.
    Returns:
        (groups, 3) float64
    """
    points, rungs = surface.points, ladder()
    n, t = points.normal[point].astype(np.float64), points.tangent[point].astype(np.float64)
    wo = eye.astype(np.float64) - points.position[point]
    x, y, z = np.array([t, np.cross(n, t), n]) @ wo / np.linalg.norm(wo)
    place = np.sqrt(1 - np.clip(z, LEAST_COSINE, 1)) * (NUM_ROWS - 1)
    row, phi = min(int(place), NUM_ROWS - 2), np.arctan2(y, x)
    share = place - row
    out = np.zeros((NUM_GROUPS, 3))
    for group, (even, uneven) in enumerate(tables.of[surface.material[point]]):
        factors = np.zeros((3, NUM_FUNCTIONS))
        if even >= 0:
            plain = np.zeros((3, NUM_FUNCTIONS))
            plain[:, rungs.cosine] = (1 - share) * tables.even[even, row] + share * tables.even[even, row + 1]
            factors += turned(plain, phi)
        if uneven >= 0:
            column = phi / (2 * np.pi) % 1 * NUM_COLUMNS
            left = int(column) % NUM_COLUMNS
            two = tables.uneven[uneven, row : row + 2]
            between = two[:, left] + (column - int(column)) * (two[:, (left + 1) % NUM_COLUMNS] - two[:, left])
            factors += (1 - share) * between[0] + share * between[1]
        out[group] = np.einsum("ck,ck->c", factors, vectors[point].astype(np.float64))
    return out
