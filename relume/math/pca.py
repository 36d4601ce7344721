"""Principal components of the curves that one parameter generates: a few vectors instead of all bands.

Nguyen, Kyung, Lee and Nam 2010, section 4:

    f(γ; p) ≈ b_0(γ) + Σ_k c_k(p) b_k(γ)    (10)

with b_0 the mean over the parameter's range and c(p) from least squares (15). Curves are rows of band averages. If a
parameter changes several curves, their outer product is one row (`joint`); the image is a linear function of it too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class PrincipalComponents:
    """A mean and orthonormal vectors, the most important first.

    Attributes:
        mean: b_0. vectors: b_1 … b_k.
    """

    mean: Shaped[F64, " J"]
    vectors: Shaped[F64, "k J"]

    def first(self, num: int) -> PrincipalComponents:
        """Return the basis with only its first, most important vectors."""
        return PrincipalComponents(self.mean, self.vectors[:num])

    def analysis(self, curves: Shaped[F64, "*batch J"]) -> Shaped[F64, "*batch k"]:
        """Coefficients c of curves, by least squares (15)."""
        return np.asarray((curves - self.mean) @ self.vectors.T)

    def synthesis(self, coefficients: Shaped[F64, "*batch k"]) -> Shaped[F64, "*batch J"]:
        """Curves b_0 + Σ c_k b_k."""
        return np.asarray(self.mean + coefficients @ self.vectors)


def decompose(curves: Shaped[F64, "n J"]) -> PrincipalComponents:
    """All principal components of curves, one curve for each value of a parameter (12 to 14)."""
    mean = curves.mean(axis=0)
    _, _, vectors = np.linalg.svd(curves - mean, full_matrices=False)
    return PrincipalComponents(mean, vectors)


def joint(bands: Sequence[F64]) -> F64:
    """Flattened outer product of curves: (J_1,), (J_2,), … -> (J_1 · J_2 · …,)"""
    return reduce(lambda product, curve: np.multiply.outer(product, curve).ravel(), bands, np.ones(1))


def relative_rms(approximation: Shaped[F64, "*shape"], exact: Shaped[F64, "*shape"]) -> float:
    """Relative RMS error √(mean (approximation − exact)² / mean exact²), over bands and parameter values."""
    return float(np.linalg.norm(approximation - exact) / np.linalg.norm(exact))


def worst_relative_rms(approximation: Shaped[F64, "n J"], exact: Shaped[F64, "n J"]) -> float:
    """Largest relative RMS error of any curve, over its bands: a bound for the image at every parameter value."""
    difference, length = np.linalg.norm(approximation - exact, axis=-1), np.linalg.norm(exact, axis=-1)
    return float(np.divide(difference, length, out=np.zeros_like(length), where=length > 0).max())
