"""Daubechies wavelets with four taps on bands: orthonormal, periodic; incremental rendering uses few coefficients.

PyWavelets' `db2` in mode `periodization`, decomposed as deep as the taps allow (four coarsest coefficients).
Coefficients are in the order of its `wavedec`: coarse, then details from coarse to fine.
"""

from __future__ import annotations

from functools import lru_cache

import numba as nb
import numpy as np
import pywt
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import ShapeMismatchError

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_WAVELET = "db2"
_MODE = "periodization"
_COARSEST = 4


def _num_levels(num_bands: int) -> int:
    if num_bands < _COARSEST or num_bands & (num_bands - 1):
        raise ShapeMismatchError(f"{num_bands} bands cannot be halved evenly; give a power of two, at least 4")
    return num_bands.bit_length() - _COARSEST.bit_length()


def analysis(bands: Shaped[F64, "*batch J"]) -> Shaped[F64, "*batch J"]:
    """Wavelet coefficients of band values, along the last axis."""
    num_levels = _num_levels(bands.shape[-1])
    if num_levels == 0:
        return np.array(bands)
    return np.concatenate(pywt.wavedec(bands, _WAVELET, mode=_MODE, level=num_levels, axis=-1), axis=-1)


def synthesis(coefficients: Shaped[F64, "*batch J"]) -> Shaped[F64, "*batch J"]:
    """Band values of wavelet coefficients, along the last axis; the inverse of `analysis`."""
    num_levels = _num_levels(coefficients.shape[-1])
    if num_levels == 0:
        return np.array(coefficients)
    cuts = [_COARSEST << level for level in range(num_levels)]
    subbands = np.split(coefficients, cuts, axis=-1)
    return np.asarray(pywt.waverec(subbands, _WAVELET, mode=_MODE, axis=-1))


@lru_cache(maxsize=16)
def matrix(num_bands: int) -> Shaped[F32, "J J"]:
    """Orthonormal M with analysis(c) = M @ c; its rows are the basis functions. Read-only."""
    basis = analysis(np.eye(num_bands)).T.astype(np.float32)
    basis.flags.writeable = False
    return basis


_H0, _H1, _H2, _H3 = (np.float32(tap) for tap in pywt.Wavelet(_WAVELET).dec_lo)


@nb.njit("void(float32[:, ::1])", nogil=True, cache=True)
def forward(block):  # type: ignore[no-untyped-def]
    """Apply `analysis` to each row, in place, for the transport vectors.

    Args:
        block: J a power of two, at least 4. (n, J) float32, C-contiguous, overwritten by coefficients.
    Cost: about 8 n J multiplications; J floats of scratch.
    """
    num_rows, length = block.shape
    scratch = np.empty(length, np.float32)
    for row in range(num_rows):
        x = block[row]
        n = length
        while n > 4:
            half = n // 2
            for k in range(half):
                # PyWavelets' alignment in this mode: taps run from 2k + 2 down to 2k - 1, periodically
                x0 = x[2 * k + 2 if k < half - 1 else 0]
                x1 = x[2 * k + 1]
                x2 = x[2 * k]
                x3 = x[2 * k - 1 if k > 0 else n - 1]
                scratch[k] = _H0 * x0 + _H1 * x1 + _H2 * x2 + _H3 * x3
                # quadrature mirror: dec_hi is dec_lo reversed with alternating signs
                scratch[half + k] = -_H3 * x0 + _H2 * x1 - _H1 * x2 + _H0 * x3
            for k in range(n):
                x[k] = scratch[k]
            n = half
