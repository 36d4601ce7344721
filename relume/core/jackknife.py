"""Figures that are estimates, with their standard errors: each independent part is left out in turn (the jackknife)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


class JackknifeEstimate(NamedTuple):
    """A value and its standard error, both of the same unit."""

    value: float
    standard_error: float


def rms_of_parts(numerators: F64, denominators: F64) -> JackknifeEstimate:
    """√(Σ squares / Σ of) over parts that were drawn at random, as a relative RMSE is.

    Args:
        numerators, denominators: of each part, what is summed above and below; no part holds all of `denominators`.
        (n,), n at least 2
    """
    without = np.sqrt(np.maximum(numerators.sum() - numerators, 0.0) / (denominators.sum() - denominators))
    return JackknifeEstimate(float(np.sqrt(numerators.sum() / denominators.sum())), jackknife(without))


def jackknife(without: F64) -> float:
    """Standard error of an estimate from its values without each part. (parts,)"""
    return float(np.sqrt((len(without) - 1) * np.mean((without - without.mean()) ** 2)))
