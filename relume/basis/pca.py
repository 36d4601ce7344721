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
from functools import cached_property, reduce

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

F64 = NDArray[np.float64]

_ROUNDING = 1e-10  # of the largest singular value of curves of length one


@dataclass(frozen=True)
class Components:
    """A mean and orthonormal vectors, the most important first.

    Attributes:
        mean: b_0. (J,). vectors: b_1 … b_k. (k, J)
    """

    mean: F64
    vectors: F64

    def first(self, num: int) -> Components:
        """With fewer vectors."""
        return Components(self.mean, self.vectors[:num])

    def analysis(self, curves: F64) -> F64:
        """c of curves, by least squares (15). (..., J) -> (..., k)"""
        return np.asarray((curves - self.mean) @ self.vectors.T)

    def synthesis(self, coefficients: F64) -> F64:
        """b_0 + Σ c_k b_k. (..., k) -> (..., J)"""
        return np.asarray(self.mean + coefficients @ self.vectors)


def decompose(curves: F64) -> Components:
    """All principal components of curves (n, J), one for each value of a parameter (12 to 14)."""
    mean = curves.mean(axis=0)
    _, _, vectors = np.linalg.svd(curves - mean, full_matrices=False)
    return Components(mean, vectors)


def joint(bands: Sequence[F64]) -> F64:
    """Products of one band of each curve, in all combinations. (J_1,), (J_2,), … -> (J_1 · J_2 · …,)"""
    return reduce(lambda product, curve: np.multiply.outer(product, curve).ravel(), bands, np.ones(1))


def joint_rows(curves: Sequence[F64]) -> F64:
    """`joint` of rows: of curves at the same values of a parameter. (n, J_1), … -> (n, J_1 · …)"""
    return np.array([joint(rows) for rows in zip(*curves, strict=True)])


def span(curves: F64) -> F64:
    """Orthonormal rows that hold curves (n, J) to rounding. (r, J)"""
    lengths = np.linalg.norm(curves, axis=1)
    _, sizes, rows = np.linalg.svd(curves[lengths > 0] / lengths[lengths > 0, None], full_matrices=False)
    return np.asarray(rows[sizes > _ROUNDING * sizes[:1]])


def relative_rms(found: F64, exact: F64) -> float:
    """√mean (found − exact)² ÷ √mean exact², over bands and values of the parameter."""
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def worst_relative_rms(found: F64, exact: F64) -> float:
    """The same for each curve, over bands, of which the largest: what bounds the picture at every value."""
    difference, length = np.linalg.norm(found - exact, axis=-1), np.linalg.norm(exact, axis=-1)
    return float(np.divide(difference, length, out=np.zeros_like(length), where=length > 0).max())


@dataclass(frozen=True)
class Nodes:
    """Values of a parameter whose curves span those of its whole range, to within an error.

    Pictures at these values do for a picture at any value what principal vectors do for curves, and each is the picture
    of a product of curves, which a joint principal vector is not.

    Attributes:
        values: of the parameter, the most important first. (k,)
        curves: at these values. (k, J)
        errors: worst relative RMS over the range with the first 1, 2, … k of them. (k,)
    """

    values: F64
    curves: F64
    errors: F64

    def first(self, num: int) -> Nodes:
        """With fewer values."""
        return Nodes(self.values[:num], self.curves[:num], self.errors[:num])

    def coefficients(self, curve: F64) -> F64:
        """Of a curve (J,) in the curves at the nodes, by least squares. (k,)"""
        return np.asarray(self._inverse @ curve)

    @cached_property
    def _inverse(self) -> F64:
        """From a curve to its coefficients. (k, J)"""
        lengths = np.linalg.norm(self.curves, axis=1)  # sharp curves are long: without this they alone would count
        return np.asarray(np.linalg.pinv(self.curves.T / lengths, rcond=_ROUNDING) / lengths[:, None])


def choose_nodes(values: F64, curves: F64, between: F64, most: int) -> Nodes:
    """At most so many nodes of a parameter: again and again the value whose curve those chosen describe worst.

    Args:
        curves: at `values`. (n, J). between: curves at other values, on which errors are measured. (m, J)
    """
    lengths = np.linalg.norm(curves, axis=1)
    some = lengths > 0  # a curve of zeros lies in any span
    basis, _, order = qr(curves[some].T / lengths[some], mode="economic", pivoting=True)
    order = np.nonzero(some)[0][order[:most]]
    length = np.linalg.norm(between, axis=1)
    unit = between[length > 0] / length[length > 0, None]
    inside = np.cumsum((unit @ basis[:, :most]) ** 2, axis=1)
    errors = np.sqrt(np.maximum(1 - inside, 0).max(axis=0))
    return Nodes(values[order], curves[order], errors)
