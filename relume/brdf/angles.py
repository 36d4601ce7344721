"""Angles of curves, as Numba kernels over local-frame directions (z = normal, x = tangent).

Each is γ(wi, wo) in radians, clamped to [0, π/2]; see docs/direct-light.md#angles. `relume.brdf.evaluate.angles_numpy`
is the NumPy reference for tests.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.brdf.term import Angle
from relume.core.numba_options import NO_REFCOUNT
from relume.math.fast_math import acos_clamped

_HALF_PI = np.float32(math.pi / 2)
_ONE = np.float32(1)
_LN2, _PER_LN2 = np.float32(math.log(2)), np.float32(1 / math.log(2))

# NumPy integers: Numba compiles a kernel anew for each Python int literal
THETA_I = np.int64(Angle.THETA_I)
THETA_H = np.int64(Angle.THETA_H)
THETA_D = np.int64(Angle.THETA_D)
THETA_R = np.int64(Angle.THETA_R)
ALPHA = np.int64(Angle.ALPHA)
BETA = np.int64(Angle.BETA)
THETA_O = np.int64(Angle.THETA_O)
LOBE = np.int64(Angle.LOBE)
TILT_X = np.int64(Angle.TILT_X)
TILT_Y = np.int64(Angle.TILT_Y)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def fast_pow(x, exponent):  # type: ignore[no-untyped-def]
    """x ** exponent for x in (0, 1] and exponent in [0, 1], relative error below 2e-6.

    Uses arithmetic only: calls of exp and log would prevent vectorization of the surrounding loops.
    """
    # x = m · 2^e with m in [0.75, 1.5); ln m = 2 artanh((m − 1)/(m + 1)), a series that is exact near m = 1
    bits = np.float32(x).view(np.int32)
    halves = (bits - np.int32(0x3F400000)) >> np.int32(23)
    m = np.int32(bits - (halves << np.int32(23))).view(np.float32)
    s = (m - _ONE) / (m + _ONE)
    s2 = s * s
    series = _ONE + s2 * (
        np.float32(1 / 3) + s2 * (np.float32(1 / 5) + s2 * (np.float32(1 / 7) + s2 * np.float32(1 / 9)))
    )
    y = exponent * (np.float32(halves) * _LN2 + np.float32(2) * s * series)
    # e^y = 2^k e^r with |r| ≤ ln 2 / 2
    y = max(y, np.float32(-80))
    k = np.int32(y * _PER_LN2 - np.float32(0.5))
    r = y - np.float32(k) * _LN2
    e = np.float32(1 / 5040) * r + np.float32(1 / 720)
    e = e * r + np.float32(1 / 120)
    e = e * r + np.float32(1 / 24)
    e = e * r + np.float32(1 / 6)
    e = e * r + np.float32(1 / 2)
    e = (e * r + _ONE) * r + _ONE
    return e * np.int32((k + np.int32(127)) << np.int32(23)).view(np.float32)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def angle_at(kind, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """γ of one pair of directions, in radians.

    Args:
        kind: an `Angle`, as its integer.
        ix, iy, iz: light direction wi, local frame, unit. float32
        ox, oy, oz: view direction wo, already multiplied by `Curve.axes`. float32
    """
    if kind == THETA_I:
        return acos_clamped(iz)
    if kind == THETA_O:
        return acos_clamped(oz)
    if kind == THETA_R:
        # reflection of wo about the normal is (-ox, -oy, oz)
        return acos_clamped(iz * oz - ix * ox - iy * oy)
    if kind == LOBE:
        return acos_clamped(ix * ox + iy * oy + iz * oz)
    hx, hy, hz = ix + ox, iy + oy, iz + oz
    # opposite directions have no half vector; the tiny constant prevents division by zero
    inverse = _ONE / math.sqrt(hx * hx + hy * hy + hz * hz + np.float32(1e-12))
    if kind == THETA_H:
        return acos_clamped(hz * inverse)
    if kind == THETA_D:
        return acos_clamped((hx * ix + hy * iy + hz * iz) * inverse)
    # tan γ = |h along the axis| / n·h, without the tangent, which has a pole
    if kind == TILT_X:
        return acos_clamped(hz / math.sqrt(hz * hz + hx * hx + np.float32(1e-12)))
    if kind == TILT_Y:
        return acos_clamped(hz / math.sqrt(hz * hz + hy * hy + np.float32(1e-12)))
    # Ashikhmin–Shirley, eqs. 15 and 16, Ben-Artzi 2006
    cos_theta_h = min(max(hz * inverse, np.float32(1e-6)), _ONE)
    across = hx * hx + hy * hy
    cos2_phi_h = hx * hx / across if across > np.float32(1e-12) else np.float32(0.5)
    power = cos2_phi_h if kind == ALPHA else _ONE - cos2_phi_h
    return acos_clamped(fast_pow(cos_theta_h, power))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def compute_angles(kind, scale, ix, iy, iz, ox, oy, oz, out):  # type: ignore[no-untyped-def]
    """γ · scale for many directions wi and one wo.

    Args:
        kind: an `Angle`. scale: e.g. bands per radian. float32
        ix, iy, iz: local wi. (n,) float32
        ox, oy, oz: local wo, scalars.
        out: output. (n,) float32
    """
    # one loop for each angle: otherwise the compiler does not vectorize it
    if kind == THETA_I:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(THETA_I, ix[k], iy[k], iz[k], ox, oy, oz)
    elif kind == THETA_H:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(THETA_H, ix[k], iy[k], iz[k], ox, oy, oz)
    elif kind == THETA_D:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(THETA_D, ix[k], iy[k], iz[k], ox, oy, oz)
    elif kind == THETA_R:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(THETA_R, ix[k], iy[k], iz[k], ox, oy, oz)
    elif kind == ALPHA:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(ALPHA, ix[k], iy[k], iz[k], ox, oy, oz)
    elif kind == BETA:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(BETA, ix[k], iy[k], iz[k], ox, oy, oz)
    elif kind == LOBE:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(LOBE, ix[k], iy[k], iz[k], ox, oy, oz)
    elif kind == TILT_X:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(TILT_X, ix[k], iy[k], iz[k], ox, oy, oz)
    elif kind == TILT_Y:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(TILT_Y, ix[k], iy[k], iz[k], ox, oy, oz)
    else:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(THETA_O, ix[k], iy[k], iz[k], ox, oy, oz)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def compute_alpha_beta(scale, ix, iy, iz, ox, oy, oz, alpha, beta):  # type: ignore[no-untyped-def]
    """γα and γβ times scales, for many directions wi and one wo, with one power: cos γα · cos γβ = cos θh.

    Args:
        scale: scale of each angle. (2,) float32. ix, iy, iz: local wi. (n,) float32
        ox, oy, oz: local wo, scalars. alpha, beta: γα and γβ, written. (n,) float32
    """
    along, across = scale[0], scale[1]
    for k in range(ix.shape[0]):
        hx, hy, hz = ix[k] + ox, iy[k] + oy, iz[k] + oz
        tangential_squared = hx * hx + hy * hy
        inverse = _ONE / math.sqrt(tangential_squared + hz * hz + np.float32(1e-12))
        cos_theta_h = min(max(hz * inverse, np.float32(1e-6)), _ONE)
        cos2_phi_h = hx * hx / tangential_squared if tangential_squared > np.float32(1e-12) else np.float32(0.5)
        cosine = fast_pow(cos_theta_h, cos2_phi_h)
        alpha[k] = along * acos_clamped(cosine)
        beta[k] = across * acos_clamped(min(cos_theta_h / cosine, _ONE))
