"""The angles that curves are functions of, as Numba kernels over local-frame directions (z = normal, x = tangent).

Each is γ(wi, wo) in radians, clamped to [0, π/2]; see docs/method.md. The NumPy twin that tests compare
with is `relume.brdf.evaluate.angles_numpy`.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.brdf.term import Angle

_HALF_PI = np.float32(math.pi / 2)
_ONE = np.float32(1)
_ZERO = np.float32(0)

THETA_I = int(Angle.THETA_I)
THETA_H = int(Angle.THETA_H)
THETA_D = int(Angle.THETA_D)
THETA_R = int(Angle.THETA_R)
ALPHA = int(Angle.ALPHA)
BETA = int(Angle.BETA)
THETA_O = int(Angle.THETA_O)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def acos_clamped(x):  # type: ignore[no-untyped-def]
    """Arc cosine of x clamped to [0, 1], in [0, π/2]; absolute error below 3e-7 (Abramowitz and Stegun 4.4.46)."""
    x = min(max(x, _ZERO), _ONE)
    p = np.float32(-0.0012624911)
    p = p * x + np.float32(0.0066700901)
    p = p * x - np.float32(0.0170881256)
    p = p * x + np.float32(0.0308918810)
    p = p * x - np.float32(0.0501743046)
    p = p * x + np.float32(0.0889789874)
    p = p * x - np.float32(0.2145988016)
    p = p * x + np.float32(1.5707963050)
    return p * math.sqrt(_ONE - x)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def angle_at(kind, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """γ of one pair of directions; `kind` is an `Angle`."""
    if kind == THETA_I:
        return acos_clamped(iz)
    if kind == THETA_O:
        return acos_clamped(oz)
    if kind == THETA_R:
        # reflection of wo about the normal is (-ox, -oy, oz)
        return acos_clamped(iz * oz - ix * ox - iy * oy)
    hx, hy, hz = ix + ox, iy + oy, iz + oz
    # opposite directions have no half vector; the tiny constant keeps the length from vanishing
    inverse = _ONE / math.sqrt(hx * hx + hy * hy + hz * hz + np.float32(1e-12))
    if kind == THETA_H:
        return acos_clamped(hz * inverse)
    if kind == THETA_D:
        return acos_clamped((hx * ix + hy * iy + hz * iz) * inverse)
    # Ashikhmin–Shirley, eqs. 15 and 16, Ben-Artzi 2006
    cos_theta_h = min(max(hz * inverse, np.float32(1e-6)), _ONE)
    across = hx * hx + hy * hy
    cos2_phi_h = hx * hx / across if across > np.float32(1e-12) else np.float32(0.5)
    power = cos2_phi_h if kind == ALPHA else _ONE - cos2_phi_h
    return acos_clamped(math.exp(power * math.log(cos_theta_h)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def angles_into(kind, scale, ix, iy, iz, ox, oy, oz, out):  # type: ignore[no-untyped-def]
    """γ · scale of many directions wi and one wo.

    Args:
        kind: an `Angle`. scale: e.g. bands per radian. float32
        ix, iy, iz: local wi. (n,) float32
        ox, oy, oz: local wo, scalars.
        out: (n,) float32, written.
    """
    # one loop for each frequent angle: only then does the compiler vectorise it
    if kind == THETA_H:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(THETA_H, ix[k], iy[k], iz[k], ox, oy, oz)
    elif kind == THETA_D:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(THETA_D, ix[k], iy[k], iz[k], ox, oy, oz)
    else:
        for k in range(ix.shape[0]):
            out[k] = scale * angle_at(kind, ix[k], iy[k], iz[k], ox, oy, oz)
