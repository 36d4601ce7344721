"""Interpolation of a measured BRDF for any pair of directions, linear between the nodes of the MERL grid.

Also its quotients by a product of curves, for the measured terms (docs/direct-light.md#measured-brdfs). All arithmetic
is float64; directions and results keep their type.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from relume.assets.measured.merl import CHANNEL_SCALE, F64, SHAPE, is_measured
from relume.core.numba_options import NO_REFCOUNT

F32 = NDArray[np.float32]

NUM_KNOTS = 90
_NUM_H, _NUM_D, _NUM_P = SHAPE
_PER_RADIAN = NUM_KNOTS / (math.pi / 2)


class QuotientKind(IntEnum):
    """Quotients of a measured BRDF: none (the whole BRDF), by the lobes of eq. 18, or by eq. 17's product."""

    WHOLE = 0
    DIFFUSE = 1
    SPECULAR = 2
    HOMOMORPHIC = 3


THETA_I, THETA_H, THETA_D, THETA_O = range(4)  # rows of a table of curves
_WHOLE, _DIFFUSE, _SPECULAR = int(QuotientKind.WHOLE), int(QuotientKind.DIFFUSE), int(QuotientKind.SPECULAR)


def build_table(planes: Shaped[F64, "3 90 90 180"]) -> Shaped[F32, "90 90 180 3"]:
    """Convert a MERL file's planes for `measured_over_model`: 1/sr, channels last, gaps filled by nearest values."""
    measured = is_measured(planes)
    nearest = distance_transform_edt(~measured, return_distances=False, return_indices=True)
    filled = planes[:, nearest[0], nearest[1], nearest[2]]
    return np.ascontiguousarray(np.moveaxis(filled * CHANNEL_SCALE[:, None, None, None], 0, -1), np.float32)


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _knot_and_fraction(position, num):  # type: ignore[no-untyped-def]
    """Node below a position, and its fractional distance to the next; constant beyond the last one."""
    position = min(max(position, 0.0), num - 1.0)
    node = min(int(position), num - 2)
    return node, position - node


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _on_curve(knots, position):  # type: ignore[no-untyped-def]
    node, fraction = _knot_and_fraction(position, NUM_KNOTS)
    return (1.0 - fraction) * knots[node] + fraction * knots[node + 1]


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _interpolate_table(table, h, d, phi, out):  # type: ignore[no-untyped-def]
    """Trilinear interpolation, periodic in φd. h, d, phi: positions in nodes. out: (3,), written."""
    h0, th = _knot_and_fraction(h, _NUM_H)
    d0, td = _knot_and_fraction(d, _NUM_D)
    p0 = int(phi)
    tp = phi - p0
    p0 = p0 % _NUM_P
    p1 = (p0 + 1) % _NUM_P
    for c in range(3):
        low = (1.0 - tp) * table[h0, d0, p0, c] + tp * table[h0, d0, p1, c]
        high = (1.0 - tp) * table[h0, d0 + 1, p0, c] + tp * table[h0, d0 + 1, p1, c]
        lower = (1.0 - td) * low + td * high
        low = (1.0 - tp) * table[h0 + 1, d0, p0, c] + tp * table[h0 + 1, d0, p1, c]
        high = (1.0 - tp) * table[h0 + 1, d0 + 1, p0, c] + tp * table[h0 + 1, d0 + 1, p1, c]
        out[c] = (1.0 - th) * lower + th * ((1.0 - td) * low + td * high)


@nb.njit(nogil=True, cache=True, error_model="numpy")
def _measured_over_model_kernel(kind, table, curves, wi_x, wi_y, wi_z, wo_x, wo_y, wo_z, out):  # type: ignore[no-untyped-def]
    """Kernel of `measured_over_model`; directions are flattened, (n,) each. out: (3, n), written."""
    value = np.empty(3)
    for n in range(wi_x.shape[0]):
        ix, iy, iz = float(wi_x[n]), float(wi_y[n]), float(wi_z[n])
        ox, oy, oz = float(wo_x[n]), float(wo_y[n]), float(wo_z[n])
        if iz <= 0.0 or oz <= 0.0:
            out[0, n] = out[1, n] = out[2, n] = 0.0
            continue
        hx, hy, hz = ix + ox, iy + oy, iz + oz
        theta_h = math.atan2(math.sqrt(hx * hx + hy * hy), hz)
        difference_length = math.sqrt((ix - ox) ** 2 + (iy - oy) ** 2 + (iz - oz) ** 2)
        theta_d = math.atan2(difference_length, math.sqrt(hx * hx + hy * hy + hz * hz))
        # sin θh sin θd times cosine and sine of φd, up to a common factor; exchanging wi and wo adds π
        phi_d = math.atan2(iy * ox - ix * oy, 0.5 * (oz - iz) * math.sqrt(hx * hx + hy * hy + hz * hz))
        if hx * hx + hy * hy < 1e-28:  # the half vector is the normal and has no azimuth; the nodes there use zero
            phi_d = math.atan2(iy, ix)
        if phi_d < 0.0:
            phi_d += math.pi
        h = math.sqrt(theta_h * (NUM_KNOTS * _PER_RADIAN))
        d = theta_d * _PER_RADIAN
        _interpolate_table(table, h, d, phi_d * (_NUM_P / math.pi), value)
        i, o = math.acos(min(iz, 1.0)) * _PER_RADIAN, math.acos(min(oz, 1.0)) * _PER_RADIAN
        for c in range(3):
            if kind == _WHOLE:
                out[c, n] = value[c]
                continue
            product = _on_curve(curves[THETA_I, c], i) * _on_curve(curves[THETA_O, c], o)
            if kind == _DIFFUSE:
                out[c, n] = min(value[c], product) / product
                continue
            lobe = _on_curve(curves[THETA_H, c], h)
            if kind == _SPECULAR:
                residual = value[c] - min(value[c], product)
                out[c, n] = residual / (lobe * _on_curve(curves[THETA_D, c], d))
            else:
                out[c, n] = value[c] / (product * lobe)


def measured_over_model(
    kind: QuotientKind,
    table: Shaped[F32, "90 90 180 3"],
    curves: Shaped[F64, "4 3 90"],
    *directions: NDArray[np.floating],
) -> Shaped[NDArray[np.floating], " 3 *batch"]:
    """Quotient of a measured BRDF by a product of curves.

    With M the measured value, G = g(θi) g'(θo), and the curves' rows being θi, θh, θd, θo: `WHOLE` M; `DIFFUSE`
    min(M, G)/G; `SPECULAR` (M − min(M, G))/(f(θh) f'(θd)); `HOMOMORPHIC` M/(G f(θh)).

    Args:
        kind: the quotient.
        table: the material, from `build_table`.
        curves: curves at their knots, positive.
        directions: x, y, z of wi and of wo, local frame, unit, z = normal; they broadcast. (...) each
    Returns:
        1/sr for `WHOLE`, without the cosine, in the type of the directions; zero at and below the horizon.
    """
    broadcast = np.broadcast_arrays(*directions)
    ix, iy, iz, ox, oy, oz = (np.ascontiguousarray(axis).ravel() for axis in broadcast)
    out = np.empty((3, ix.size), ix.dtype)
    _measured_over_model_kernel(int(kind), table, curves, ix, iy, iz, ox, oy, oz, out)
    return out.reshape(3, *broadcast[0].shape)


def evaluate_measured(
    table: Shaped[F32, "90 90 180 3"], wi: Shaped[F64, "*wi 3"], wo: Shaped[F64, "*wo 3"]
) -> Shaped[F64, "*batch 3"]:
    """The measured BRDF, 1/sr, without the cosine.

    Args:
        table: the material, from `build_table`.
        wi, wo: local frame, unit, z = normal; they broadcast.
    Returns:
        Zero at and below the horizon.
    """
    unused_curves = np.empty((4, 3, NUM_KNOTS))
    values = measured_over_model(
        QuotientKind.WHOLE, table, unused_curves, *np.moveaxis(wi, -1, 0), *np.moveaxis(wo, -1, 0)
    )
    return np.moveaxis(np.asarray(values, np.float64), 0, -1)
