"""Curves along a parameter as linear combinations of the curves at a few values, with an error bound per band.

A pixel is a sum of a curve's bands with nonnegative weights. If a combination approximates *every* band to a relative
error ε of the band plus a floor, every pixel has at most the error ε of its value plus the image of the floor, for any
lighting. A norm over all bands guarantees nothing for a pixel that one light illuminates through one band.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F64 = NDArray[np.float64]

# The floor of a curve: this fraction of its mean over all directions, at least the second fraction of the largest mean.
_FLOOR_PER_MEAN = 1e-2
_FLOOR_PER_MAX_MEAN = 1e-5
# Large coefficients of opposite signs would cancel and amplify the rounding of images.
_RIDGE = 1e-4
_ROUNDS = 4
_BATCH_ERROR_RATIO = 4
_MIN_NODE_DISTANCE = 3  # between nodes of one batch: a node also reduces the error of its neighbors


@dataclass(frozen=True)
class CurveNodes:
    """Parameter values whose curves combine to the curves of the whole range.

    Attributes:
        values: parameter values, in the order of selection. curves: curves at these values.
        band_weights: fraction of all directions in each band; they sum to one.
        min_floor: lower bound of the floor of every curve.
        error: largest error of any band of any curve in the range, relative to the band plus the floor.
    """

    values: Shaped[F64, " k"]
    curves: Shaped[F64, "k J"]
    band_weights: Shaped[F64, " J"]
    min_floor: float
    error: float

    def coefficients(self, curve: Shaped[F64, " J"]) -> Shaped[F64, " k"]:
        """Coefficients of a curve in the curves at the nodes, with nearly the least maximum error of a band."""
        return _fit(self.curves, curve, self.floor(curve))[0]

    def floor(self, curve: Shaped[F64, " J"]) -> float:
        """Constant added to each band as the scale of its error: a hundredth of the curve's mean over directions."""
        return max(_FLOOR_PER_MEAN * float(curve @ self.band_weights), self.min_floor)


def choose_nodes(
    values: Shaped[F64, " n"],
    curves: Shaped[F64, "n J"],
    midpoint_curves: Shaped[F64, "midpoints J"],
    weights: Shaped[F64, " J"],
    max_nodes: int,
    tolerance: float,
) -> CurveNodes:
    """Choose nodes of a parameter greedily: add a value next to the curve with the largest error.

    Args:
        values: ascending, ends included. curves: at `values`.
        midpoint_curves: curves halfway from each value to the next, where errors are measured.
        weights: solid angle of each band.
        max_nodes: maximum number of nodes. tolerance: stop at this error.
    Cost: O(n · max_nodes² · J) time.
    """
    band_weights = weights / weights.sum()
    min_floor = _FLOOR_PER_MAX_MEAN * float((curves @ band_weights).max())
    node_indices = [0, len(values) - 1]
    while True:
        nodes = CurveNodes(values[node_indices], curves[node_indices], band_weights, min_floor, np.inf)
        errors = np.array([_fit(nodes.curves, curve, nodes.floor(curve))[1] for curve in midpoint_curves])
        error = float(errors.max())
        # add several nodes at once while the error is far above the tolerance
        batch_size = len(node_indices) // 5 if error > _BATCH_ERROR_RATIO * tolerance else 1
        num = 0 if error <= tolerance else min(max(1, batch_size), max_nodes - len(node_indices))
        new_indices = _worst_neighbors(errors, node_indices, num)
        if not new_indices:
            return CurveNodes(nodes.values, nodes.curves, band_weights, min_floor, error)
        node_indices += new_indices


def _worst_neighbors(errors: F64, node_indices: list[int], num: int) -> list[int]:
    """At most `num` values that are not nodes yet, each next to one of the largest errors, in descending order.

    Args:
        errors: halfway from each value to the next. (n − 1,)
    """
    new_indices: list[int] = []
    for midpoint_index in map(int, np.argsort(-errors)):
        if len(new_indices) == num:
            break
        candidates = [k for k in (midpoint_index, midpoint_index + 1) if k not in node_indices]
        if candidates and all(abs(candidates[0] - k) > _MIN_NODE_DISTANCE for k in new_indices):
            new_indices.append(candidates[0])
    return new_indices


def _fit(node_curves: F64, curve: F64, floor: float) -> tuple[F64, float]:
    """Coefficients of a curve (J,) in `node_curves` (k, J), and the largest relative error of a band.

    Iteratively reweighted least squares of the relative errors; large errors get more weight. Each node's scaled curve
    is normalized to a maximum of one, so that the ridge makes sharp nodes cheap only where the curve is sharp too.
    """
    if floor <= 0:  # all curves of the parameter are zero
        return np.zeros(len(node_curves)), 0.0
    scale = 1 / (curve + floor)
    scaled_curves, target = node_curves * scale, curve * scale
    largest = np.max(scaled_curves, axis=1)
    largest[largest == 0] = 1
    scaled_curves /= largest[:, None]
    ridge = _RIDGE**2 * np.eye(len(node_curves))
    best: F64 = np.zeros(len(node_curves), np.float64)
    weight: F64 = np.ones_like(curve)
    lowest_error = np.inf
    for _ in range(_ROUNDS):
        weighted = scaled_curves * weight
        coefficients = np.linalg.solve(weighted @ scaled_curves.T + ridge, weighted @ target)
        residuals = np.abs(coefficients @ scaled_curves - target)
        error = float(residuals.max())
        if error < lowest_error:
            best, lowest_error = np.asarray(coefficients, np.float64), error
        weight = np.asarray(weight * (residuals / max(error, 1e-300) + 0.02), np.float64)
    return best / largest, lowest_error
