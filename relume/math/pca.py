"""Principal components of the curves that one parameter generates: a few vectors in the place of all bands.

Nguyen, Kyung, Lee and Nam 2010, section 4:

    f(γ; p) ≈ b_0(γ) + Σ_k c_k(p) b_k(γ)    (10)

with b_0 the mean over the parameter's range and c(p) found by least squares (15). Curves are rows of band averages; the
curves of a parameter that moves several are multiplied into one row (`joint`), of which a picture is a linear function
too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class PrincipalComponents:
    """A mean and orthonormal vectors, the most important first.

    Attributes:
        mean: b_0. (J,). vectors: b_1 … b_k. (k, J)
    """

    mean: F64
    vectors: F64

    def first(self, num: int) -> PrincipalComponents:
        """The same basis with only its first, most important vectors."""
        return PrincipalComponents(self.mean, self.vectors[:num])

    def analysis(self, curves: F64) -> F64:
        """c of curves, by least squares (15). (..., J) -> (..., k)"""
        return np.asarray((curves - self.mean) @ self.vectors.T)

    def synthesis(self, coefficients: F64) -> F64:
        """b_0 + Σ c_k b_k. (..., k) -> (..., J)"""
        return np.asarray(self.mean + coefficients @ self.vectors)


def decompose(curves: F64) -> PrincipalComponents:
    """All principal components of curves (n, J), one for each value of a parameter (12 to 14)."""
    mean = curves.mean(axis=0)
    _, _, vectors = np.linalg.svd(curves - mean, full_matrices=False)
    return PrincipalComponents(mean, vectors)


def joint(bands: Sequence[F64]) -> F64:
    """Products of one band of each curve, in all combinations. (J_1,), (J_2,), … -> (J_1 · J_2 · …,)"""
    return reduce(lambda product, curve: np.multiply.outer(product, curve).ravel(), bands, np.ones(1))


def relative_rms(approximation: F64, exact: F64) -> float:
    """√mean (found − exact)² ÷ √mean exact², over bands and values of the parameter."""
    return float(np.linalg.norm(approximation - exact) / np.linalg.norm(exact))


def worst_relative_rms(approximation: F64, exact: F64) -> float:
    """The same for each curve, over bands, of which the largest: what bounds the picture at every value."""
    difference, length = np.linalg.norm(approximation - exact, axis=-1), np.linalg.norm(exact, axis=-1)
    return float(np.divide(difference, length, out=np.zeros_like(length), where=length > 0).max())
