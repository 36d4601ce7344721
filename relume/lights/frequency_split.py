"""Low-/high-frequency split of an environment: spherical harmonics, and the triangles that these would blur.

Harmonics of an environment with a sun represent neither the sun nor the rest. The fit therefore minimizes the absolute
differences of all triangles instead of their squares: then few triangles differ by much (the sun and other bright
regions), all others by little. Those few are kept as residual lights, with all of their shadows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.lights.spherical_triangles import TriangleLights
from relume.math.spherical_harmonics import NUM_HARMONICS

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MAX_RESIDUAL_FRACTION = 0.03  # of all light, represented by neither harmonics nor triangles
_NUM_ROUNDS = 8
_MIN_DIFFERENCE_FRACTION = 0.003  # of the mean triangle's light: smaller differences are squared
_DAMPING = 1e-6


class FrequencySplit(NamedTuple):
    """Light of M triangles, split.

    Attributes:
        low_frequency: coefficients of the low-frequency part.
        residual_triangles: indices of N triangles with a residual. residual: these, with signed differences.
    """

    low_frequency: Shaped[F32, "harmonics 3"]
    residual_triangles: Shaped[NDArray[np.intp], " N"]
    residual: TriangleLights


def split_frequencies(lights: TriangleLights, basis: Shaped[F64, "M harmonics"]) -> FrequencySplit:
    """Split light into spherical harmonics and as few triangles as leave at most `_MAX_RESIDUAL_FRACTION`.

    Args:
        lights: M triangles. basis: weights of the triangles for each harmonic.
    """
    light = lights.irradiance.astype(np.float64)
    total = float(np.abs(light).sum())
    if total == 0:
        return FrequencySplit(np.zeros((NUM_HARMONICS, 3), np.float32), np.empty(0, np.intp), lights.empty())
    low_frequency = _fit_harmonics(basis, light, total)
    residual = light - basis @ low_frequency
    size = np.abs(residual).sum(axis=1)
    order = np.argsort(-size, kind="stable")
    tail = _tail_sums(size[order])
    residual_triangles = np.sort(order[: int(np.argmax(tail <= _MAX_RESIDUAL_FRACTION * total))])
    return FrequencySplit(
        low_frequency.astype(np.float32),
        residual_triangles,
        lights.select(residual_triangles, residual[residual_triangles].astype(np.float32)),
    )


def _tail_sums(sizes: F64) -> F64:
    """Return the sums of sizes (n,) without the first 0, 1, … n. (n + 1,)"""
    return np.asarray(np.concatenate([np.cumsum(sizes[::-1])[::-1], [0.0]]))


def _fit_harmonics(basis: F64, light: F64, total: float) -> F64:
    """Minimize Σ |light − basis · c| by iteratively reweighted least squares. (harmonics, 3)"""
    min_difference = _MIN_DIFFERENCE_FRACTION * total / len(light)
    weight = np.full(len(light), 1 / min_difference)
    coefficients = np.zeros((basis.shape[1], light.shape[1]))
    for _ in range(_NUM_ROUNDS):
        weighted_basis = basis * weight[:, None]
        normal = weighted_basis.T @ basis
        normal += _DAMPING * np.trace(normal) / len(normal) * np.eye(len(normal))
        coefficients = np.linalg.solve(normal, weighted_basis.T @ light)
        weight = 1 / np.maximum(np.abs(light - basis @ coefficients).sum(axis=1), min_difference)
    return coefficients
