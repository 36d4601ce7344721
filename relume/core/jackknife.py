"""Jackknife standard errors: estimates with each independent part left out in turn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F64 = NDArray[np.float64]


class JackknifeEstimate(NamedTuple):
    """A value and its standard error, in the same unit."""

    value: float
    standard_error: float


def ratio_of_parts(numerators: Shaped[F64, " n"], denominators: Shaped[F64, " n"]) -> JackknifeEstimate:
    """Ratio Σ numerators / Σ denominators over randomly drawn parts, such as a mean.

    Args:
        numerators, denominators: as for `rms_of_parts`.
    """
    without = (numerators.sum() - numerators) / (denominators.sum() - denominators)
    return JackknifeEstimate(float(numerators.sum() / denominators.sum()), jackknife(without))


def rms_of_parts(numerators: Shaped[F64, " n"], denominators: Shaped[F64, " n"]) -> JackknifeEstimate:
    """Ratio √(Σ numerators / Σ denominators) over randomly drawn parts, such as a relative RMSE.

    Args:
        numerators, denominators: sums of each of at least 2 parts; no part holds all of `denominators`.
    """
    without = np.sqrt(np.maximum(numerators.sum() - numerators, 0.0) / (denominators.sum() - denominators))
    return JackknifeEstimate(float(np.sqrt(numerators.sum() / denominators.sum())), jackknife(without))


def jackknife(without: Shaped[F64, " n"]) -> float:
    """Standard error of an estimate from its values with each part left out."""
    return float(np.sqrt((len(without) - 1) * np.mean((without - without.mean()) ** 2)))
