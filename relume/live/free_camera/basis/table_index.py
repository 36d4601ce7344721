"""Indices of view directions in tables over θo and φo."""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT
from relume.live.free_camera.basis.outgoing_coefficients import NUM_ROWS

MIN_COSINE = np.float32(0.01)  # of θo; a visible pixel may interpolate probes that face away slightly


@nb.njit(nogil=True, cache=True, forceinline=True, **NO_REFCOUNT)
def table_row(cosine):  # type: ignore[no-untyped-def]
    """Return the row of cos θo in tables, and the fraction toward the next row."""
    row_coordinate = math.sqrt(max(np.float32(1) - cosine, np.float32(0))) * np.float32(NUM_ROWS - 1)
    row: Any = min(np.int64(row_coordinate), NUM_ROWS - 2)
    return row, np.float32(row_coordinate - row)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def powers_of_rotation(cosine_phi, sine_phi, degree, out):  # type: ignore[no-untyped-def]
    """Compute cos mφ and sin mφ of all orders m up to a degree from cos φ, `cosine_phi`, and sin φ, `sine_phi`.

    Args:
        cosine_phi, sine_phi: of the angle. degree: the highest order. out: (2, ≥ degree + 1), written.
    """
    out[0, 0], out[1, 0] = np.float32(1), np.float32(0)
    for m in range(1, degree + 1):
        re, im = out[0, m - 1], out[1, m - 1]
        out[0, m], out[1, m] = re * cosine_phi - im * sine_phi, re * sine_phi + im * cosine_phi


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def view_direction(viewed, p):  # type: ignore[no-untyped-def]
    """Return ωo of a probe, a tuple. viewed: `ViewedProbes`. p: the probe."""
    origin, position = viewed.camera_position, viewed.points.position
    x, y, z = origin[0] - position[p, 0], origin[1] - position[p, 1], origin[2] - position[p, 2]
    scale = np.float32(1) / math.sqrt(max(x * x + y * y + z * z, np.float32(1e-20)))
    return scale * x, scale * y, scale * z


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def view_direction_local(viewed, p):  # type: ignore[no-untyped-def]
    """Return table coordinates of a probe's ωo: a row, the fraction toward the next, and cos φo, sin φo."""
    (x, y, z), n, t = view_direction(viewed, p), viewed.points.normal[p], viewed.points.tangent[p]
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    across, along = t[0] * x + t[1] * y + t[2] * z, bx * x + by * y + bz * z
    cosine = min(max(n[0] * x + n[1] * y + n[2] * z, MIN_COSINE), np.float32(1))
    length = math.sqrt(across * across + along * along)
    row, fraction = table_row(cosine)
    if length < np.float32(1e-6):
        return row, fraction, np.float32(1), np.float32(0)
    return row, fraction, np.float32(across / length), np.float32(along / length)
