"""Figures that are estimates, with their standard errors: each independent part is left out in turn (the jackknife)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


class Estimated(NamedTuple):
    """A value and its standard error, both of the same unit."""

    value: float
    standard_error: float


def root_of_shares(squares: F64, of: F64) -> Estimated:
    """√(Σ squares / Σ of) over parts that were drawn at random, as a relative RMSE is.

    Args:
        squares, of: of each part, what is summed above and below; no part holds all of `of`. (n,), n at least 2
    """
    without = np.sqrt(np.maximum(squares.sum() - squares, 0.0) / (of.sum() - of))
    return Estimated(float(np.sqrt(squares.sum() / of.sum())), jackknife(without))


def jackknife(without: F64) -> float:
    """Standard error of an estimate from its values without each part. (parts,)"""
    return float(np.sqrt((len(without) - 1) * np.mean((without - without.mean()) ** 2)))
