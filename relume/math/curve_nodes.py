"""Curves along a parameter as combinations of those at a few of its values, each band to a share of itself.

A pixel is a sum of a curve's bands with weights that are never negative. So where a combination holds *every* band to a
share ε of itself and of a floor, every pixel is held to ε of itself and of what the floor would show, whatever light
falls on it. A norm over all bands promises nothing for a pixel that one lamp lights through one band.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

# The floor of a curve: this share of its mean over all directions, and of the same share of the largest mean.
_FLOOR_PER_MEAN = 1e-2
_FLOOR_PER_MAX_MEAN = 1e-5
# Large coefficients of both signs would cancel, and rounding of images with them.
_RIDGE = 1e-4
_ROUNDS = 4
_BATCH_ERROR_RATIO = 4
_MIN_NODE_DISTANCE = (
    3  # nodes that are added together stand further from each other: one mends the error of its neighbours too
)


@dataclass(frozen=True)
class CurveNodes:
    """Values of a parameter whose curves combine to those of its whole range.

    Attributes:
        values: of the parameter, in the order in which they were found wanting. (k,)
        curves: at these values. (k, J)
        band_weights: of all directions that lie in each band; they sum to one. (J,)
        min_floor: no curve's floor is lower.
        error: the largest of any band of any curve in the range, as a share of itself and its floor.
    """

    values: F64
    curves: F64
    band_weights: F64
    min_floor: float
    error: float

    def coefficients(self, curve: F64) -> F64:
        """Of a curve (J,) in the curves at the nodes: the least largest error of a band, nearly. (k,)"""
        return _fit(self.curves, curve, self.floor(curve))[0]

    def floor(self, curve: F64) -> float:
        """What a band's error is measured by, besides the band: a hundredth of what the curve is spread evenly."""
        return max(_FLOOR_PER_MEAN * float(curve @ self.band_weights), self.min_floor)


def choose_nodes(
    values: F64, curves: F64, midpoint_curves: F64, weights: F64, max_nodes: int, tolerance: float
) -> CurveNodes:
    """Nodes of a parameter: again and again a value beside the curve that those chosen describe worst.

    Args:
        values: in order, ends included. (n,) curves: at `values`. (n, J)
        midpoint_curves: curves halfway from each value to the next, on which errors are measured. (n − 1, J)
        weights: solid angle of each band. (J,)
        max_nodes: how many nodes at most. tolerance: stop at this error.
    Cost: O(n · most² · J) time.
    """
    band_weights = weights / weights.sum()
    min_floor = _FLOOR_PER_MAX_MEAN * float((curves @ band_weights).max())
    node_indices = [0, len(values) - 1]
    while True:
        nodes = CurveNodes(values[node_indices], curves[node_indices], band_weights, min_floor, np.inf)
        errors = np.array([_fit(nodes.curves, curve, nodes.floor(curve))[1] for curve in midpoint_curves])
        error = float(errors.max())
        # many at once, as long as they are all of use
        batch_size = len(node_indices) // 5 if error > _BATCH_ERROR_RATIO * tolerance else 1
        num = 0 if error <= tolerance else min(max(1, batch_size), max_nodes - len(node_indices))
        new_indices = _worst_neighbors(errors, node_indices, num)
        if not new_indices:
            return CurveNodes(nodes.values, nodes.curves, band_weights, min_floor, error)
        node_indices += new_indices


def _worst_neighbors(errors: F64, node_indices: list[int], num: int) -> list[int]:
    """At most so many values that are no nodes yet, each beside one of the worst errors, the worst first.

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
    """Coefficients of a curve (J,) in some (k, J), and the largest error of a band.

    Least squares of the relative errors, with more weight, a few times, where they were large. Each node's part is
    scaled to be one at most, so that sharp nodes are cheap only where the curve is sharp too.
    """
    if floor <= 0:  # the parameter makes nothing of its curves, anywhere
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
