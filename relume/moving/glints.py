"""What lobes show of the light at points: how much of the sky, and what surfaces and lamps send there.

Both come from the light vectors, since functions that are orthonormal under the cosine give back what they are made of:

    V(ω) ≈ Σ_k v_k h_k(ω),   v_k = ∫ V cos θ h_k dω,   and the same of radiance
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import functions_along, ladder
from relume.moving.basis.lobes import Lobes
from relume.moving.basis.out_factors import NUM_ROWS
from relume.moving.points.surface import Surface
from relume.parallel import for_shares

F32 = NDArray[np.float32]

LEAST_COSINE = np.float32(0.01)  # of θo: what is interpolated between points may be seen from a little below them


@nb.njit(nogil=True, cache=True, inline="always")
def row_of(cosine):  # type: ignore[no-untyped-def]
    """Find where cos θo lies in tables: a row, and the share of the next."""
    place = math.sqrt(max(np.float32(1) - cosine, np.float32(0))) * np.float32(NUM_ROWS - 1)
    row: Any = min(np.int64(place), NUM_ROWS - 2)
    return row, np.float32(place - row)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def along_lobe(lobes, lobe, n, d):  # type: ignore[no-untyped-def]
    """Find where a lobe looks.

    Args:
        lobes, lobe: which. n: the normal, d: from the eye, unit.
    Returns:
        A row of its table and the share of the next; its direction, three numbers; its width σ.
    """
    facing = -(n[0] * d[0] + n[1] * d[1] + n[2] * d[2])
    cosine: Any = min(max(facing, LEAST_COSINE), np.float32(1))
    row, share = row_of(cosine)
    mean = lobes.mean[lobe, row] + share * (lobes.mean[lobe, row + 1] - lobes.mean[lobe, row])
    sigma = lobes.sigma[lobe, row] + share * (lobes.sigma[lobe, row + 1] - lobes.sigma[lobe, row])
    ax, ay, az = d[0] + facing * n[0], d[1] + facing * n[1], d[2] + facing * n[2]
    length = math.sqrt(max(ax * ax + ay * ay + az * az, np.float32(1e-20)))
    flat = math.sqrt(max(np.float32(1) - mean * mean, np.float32(0))) / length
    return row, share, flat * ax + mean * n[0], flat * ay + mean * n[1], flat * az + mean * n[2], sigma


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _glance(rungs, points, material, sky, others, lobes, eye, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Look along lobes from the points that are [start, stop) of rows. out: (points, 4), the sky's share, then others'
    radiance"""
    position, normal, tangent, _ = points
    functions = np.empty(sky.shape[1], np.float32)
    for p in rows[start:stop]:
        lobe = lobes.of[material[p]]
        out[p] = 0
        if lobe < 0:
            continue
        nx, ny, nz = normal[p, 0], normal[p, 1], normal[p, 2]
        tx, ty, tz = tangent[p, 0], tangent[p, 1], tangent[p, 2]
        bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        x, y, z = eye[0] - position[p, 0], eye[1] - position[p, 1], eye[2] - position[p, 2]
        scale = np.float32(1) / math.sqrt(max(x * x + y * y + z * z, np.float32(1e-20)))
        cosine: Any = min(max(scale * (nx * x + ny * y + nz * z), LEAST_COSINE), np.float32(1))
        across, along = tx * x + ty * y + tz * z, bx * x + by * y + bz * z
        length = math.sqrt(across * across + along * along)
        row, share = row_of(cosine)
        mean = lobes.mean[lobe, row] + share * (lobes.mean[lobe, row + 1] - lobes.mean[lobe, row])
        flat = math.sqrt(max(np.float32(1) - mean * mean, np.float32(0)))
        outward = -flat / length if length > 0 else np.float32(0)
        functions_along(rungs, np.float32(outward * across), np.float32(outward * along), functions)
        seen = np.float32(0)
        for k in range(sky.shape[1]):
            seen += functions[k] * sky[p, k]
        out[p, 0] = min(max(seen, np.float32(0)), np.float32(1))
        if not lobes.is_told[lobe]:
            for channel in range(3):
                radiance = np.float32(0)
                for k in range(sky.shape[1]):
                    radiance += functions[k] * others[p, channel, k]
                out[p, 1 + channel] = max(radiance, np.float32(0))


def glance(
    surface: Surface,
    sky: F32,
    others: F32,
    lobes: Lobes,
    eye: F32,
    is_needed: NDArray[np.uint8],
    out: F32 | None = None,
) -> F32:
    """Look from points along their lobes.

    Args:
        surface: whose points. sky: v, what each sees of the sky. (points, K) float32
        others: t of all light but the sky's own; lobes that the in-basis tells leave it to that.
            (points, 3, K) float32
        lobes: of all materials. eye: where it is. (3,) float32
        is_needed: points that are asked. (points,) uint8
        out: written where needed; None: the others have nothing.
    Returns:
        The share of the sky that is seen there, and the radiance of what hides it. (points, 4) float32
    """
    found = np.zeros((len(sky), 4), np.float32) if out is None else out
    rows = np.flatnonzero(is_needed.view(np.bool_))
    args = (
        ladder(),
        surface.points,
        surface.material,
        sky,
        others,
        lobes,
        np.ascontiguousarray(eye, np.float32),
        rows,
    )
    for_shares(lambda start, stop: _glance(*args, start, stop, found), len(rows))
    return found
