"""Cosines of the half vector, shared by the quotients. Local frame, z = normal; float32 in gives float32 out."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

# Cosines below this are within 2e-4 degrees of the horizon. Quotients divide by them, and one over their square must
# stay finite in float32; it is, at 1e12.
MIN_COSINE = np.float32(1e-6)
# Float constants of Numba are float64 and would drag the float32 loops along; these are exact in both.
ZERO, ONE, TWO, HALF = np.float32(0), np.float32(1), np.float32(2), np.float32(0.5)


@nb.njit(nogil=True, cache=True)
def half_vector_cosines(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """cos θh = n·h and cos θd = wo·h = |wi + wo| / 2, of unit directions above the horizon.

    Returns:
        (cos_theta_h, cos_theta_d); the latter at least MIN_COSINE, since opposite directions have no half vector.
    """
    h_x, h_y, h_z = wi_x + wo_x, wi_y + wo_y, wi_z + wo_z
    cos_theta_d = max(HALF * math.sqrt(h_x * h_x + h_y * h_y + h_z * h_z), MIN_COSINE)
    cos_theta_h = min(HALF * h_z / cos_theta_d, ONE)  # rounding may carry it past one
    return cos_theta_h, cos_theta_d


_DIRECTIONS_F32 = nb.float32(nb.float32, nb.float32, nb.float32, nb.float32, nb.float32, nb.float32)
_DIRECTIONS_F64 = nb.float64(nb.float64, nb.float64, nb.float64, nb.float64, nb.float64, nb.float64)
# decorator that makes the ufunc of `Term.quotient`
quotient_ufunc = nb.vectorize([_DIRECTIONS_F32, _DIRECTIONS_F64], nopython=True, cache=True)  # type: ignore[no-untyped-call]
