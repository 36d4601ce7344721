"""Helpers for quotients: cosines of the half vector, and lazily compiled ufuncs. Local frame, z = normal."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from typing import Any

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT

# Cosines below this are within 2e-4 degrees of the horizon. Quotients divide by them; the inverse square, 1e12, stays
# finite in float32.
MIN_COSINE = np.float32(1e-6)
# Float literals in Numba are float64 and would promote the float32 loops; these constants are exact in both.
ZERO, ONE, TWO, HALF = np.float32(0), np.float32(1), np.float32(2), np.float32(0.5)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def half_vector_cosines(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """Cosines cos θh = n·h and cos θd = wo·h = |wi + wo| / 2 of unit directions above the horizon.

    Args:
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    Returns:
        (cos_theta_h, cos_theta_d); the latter at least MIN_COSINE, since opposite directions have no half vector.
    """
    h_x, h_y, h_z = wi_x + wo_x, wi_y + wo_y, wi_z + wo_z
    cos_theta_d = max(HALF * math.sqrt(h_x * h_x + h_y * h_y + h_z * h_z), MIN_COSINE)
    cos_theta_h = min(HALF * h_z / cos_theta_d, ONE)  # rounding may exceed one
    return cos_theta_h, cos_theta_d


class LazyUfunc:
    """A ufunc that is compiled, or loaded from the cache, on its first call: few processes need every term."""

    def __init__(self, function: Callable[..., Any], signatures: Sequence[Any]) -> None:
        self._function, self._signatures = function, signatures
        self._lock = threading.Lock()
        self._ufunc: Callable[..., Any] | None = None
        self.__doc__ = function.__doc__

    def __call__(self, *args: Any) -> Any:
        """Apply the ufunc; the first call compiles or loads it."""
        return (self._ufunc or self._compile())(*args)

    def _compile(self) -> Callable[..., Any]:
        with self._lock:
            if self._ufunc is None:
                vectorize = nb.vectorize(self._signatures, nopython=True, cache=True)  # type: ignore[no-untyped-call]
                self._ufunc = vectorize(self._function)
            return self._ufunc


def quotient_ufunc_with(num_fixed: int) -> Callable[[Callable[..., Any]], LazyUfunc]:
    """Make a decorator for a quotient with fixed parameters before the six components of wi and wo.

    float32 directions give float32.
    """
    signatures = [kind(*[kind] * (num_fixed + 6)) for kind in (nb.float32, nb.float64)]
    return lambda function: LazyUfunc(function, signatures)


# decorator that makes the ufunc of `Term.quotient`
quotient_ufunc = quotient_ufunc_with(0)


@quotient_ufunc
def hemisphere_indicator(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """One above the horizon, else zero: the quotient of terms that consist of curves alone.

    Args:
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    """
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    return ONE
