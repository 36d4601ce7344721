"""The angle bands themselves as a basis, with the interface of `relume.math.daubechies`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def analysis(bands: F64) -> F64:
    """Return a copy: band values are their own coefficients. (..., J) -> (..., J)"""
    return np.array(bands)


def synthesis(coefficients: F64) -> F64:
    """Return a copy: band values are their own coefficients. (..., J) -> (..., J)"""
    return np.array(coefficients)


def matrix(num_bands: int) -> F32:
    """The identity matrix, whose rows are the basis functions. (J, J) float32"""
    return np.eye(num_bands, dtype=np.float32)


def forward(block: F32) -> None:
    """Leave the block unchanged. (n, J)"""
