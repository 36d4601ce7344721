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
_FLOOR_OF_MEAN = 1e-2
_FLOOR_OF_LARGEST = 1e-5
# Large coefficients of both signs would cancel, and rounding of images with them.
_RIDGE = 1e-4
_ROUNDS = 4
_FAR = 4
_APART = 3  # nodes that are added together stand further from each other: one mends the error of its neighbours too


@dataclass(frozen=True)
class Nodes:
    """Values of a parameter whose curves combine to those of its whole range.

    Attributes:
        values: of the parameter, in the order in which they were found wanting. (k,)
        curves: at these values. (k, J)
        shares: of all directions that lie in each band; they sum to one. (J,)
        least_floor: no curve's floor is lower.
        error: the largest of any band of any curve in the range, as a share of itself and its floor.
    """

    values: F64
    curves: F64
    shares: F64
    least_floor: float
    error: float

    def coefficients(self, curve: F64) -> F64:
        """Of a curve (J,) in the curves at the nodes: the least largest error of a band, nearly. (k,)"""
        return _fitted(self.curves, curve, self.floor(curve))[0]

    def floor(self, curve: F64) -> float:
        """What a band's error is measured by, besides the band: a hundredth of what the curve is spread evenly."""
        return max(_FLOOR_OF_MEAN * float(curve @ self.shares), self.least_floor)


def choose_nodes(values: F64, curves: F64, between: F64, weights: F64, most: int, enough: float) -> Nodes:
    """Nodes of a parameter: again and again a value beside the curve that those chosen describe worst.

    Args:
        values: in order, ends included. (n,) curves: at `values`. (n, J)
        between: curves halfway from each value to the next, on which errors are measured. (n − 1, J)
        weights: solid angle of each band. (J,)
        most: how many nodes at most. enough: stop at this error.
    Cost: O(n · most² · J) time.
    """
    shares = weights / weights.sum()
    least = _FLOOR_OF_LARGEST * float((curves @ shares).max())
    chosen = [0, len(values) - 1]
    while True:
        nodes = Nodes(values[chosen], curves[chosen], shares, least, np.inf)
        errors = np.array([_fitted(nodes.curves, curve, nodes.floor(curve))[1] for curve in between])
        error = float(errors.max())
        room = len(chosen) // 5 if error > _FAR * enough else 1  # many at once, as long as they are all of use
        num = 0 if error <= enough else min(max(1, room), most - len(chosen))
        wanting = _beside_worst(errors, chosen, num)
        if not wanting:
            return Nodes(nodes.values, nodes.curves, shares, least, error)
        chosen += wanting


def _beside_worst(errors: F64, chosen: list[int], num: int) -> list[int]:
    """At most so many values that are no nodes yet, each beside one of the worst errors, the worst first.

    Args:
        errors: halfway from each value to the next. (n − 1,)
    """
    found: list[int] = []
    for at in map(int, np.argsort(-errors)):
        if len(found) == num:
            break
        beside = [k for k in (at, at + 1) if k not in chosen]
        if beside and all(abs(beside[0] - k) > _APART for k in found):
            found.append(beside[0])
    return found


def _fitted(nodes: F64, curve: F64, floor: float) -> tuple[F64, float]:
    """Coefficients of a curve (J,) in some (k, J), and the largest error of a band.

    Least squares of the relative errors, with more weight, a few times, where they were large. Each node's part is
    scaled to be one at most, so that sharp nodes are cheap only where the curve is sharp too.
    """
    if floor <= 0:  # the parameter makes nothing of its curves, anywhere
        return np.zeros(len(nodes)), 0.0
    scale = 1 / (curve + floor)
    parts, target = nodes * scale, curve * scale
    largest = np.max(parts, axis=1)
    largest[largest == 0] = 1
    parts /= largest[:, None]
    ridge = _RIDGE**2 * np.eye(len(nodes))
    best: F64 = np.zeros(len(nodes), np.float64)
    weight: F64 = np.ones_like(curve)
    least = np.inf
    for _ in range(_ROUNDS):
        weighed = parts * weight
        found = np.linalg.solve(weighed @ parts.T + ridge, weighed @ target)
        off = np.abs(found @ parts - target)
        error = float(off.max())
        if error < least:
            best, least = np.asarray(found, np.float64), error
        weight = np.asarray(weight * (off / max(error, 1e-300) + 0.02), np.float64)
    return best / largest, least
