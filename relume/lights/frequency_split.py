"""Light of an environment, divided: what is smooth goes into harmonics, what these would blur stays on its triangles.

Harmonics of a whole sky with a sun in it are neither the sky nor the sun. The absolute differences of all triangles are
made as small as they get instead of their squares: then few triangles differ by much, lamps and the sun, and all others
by little. Those few are told beside the harmonics, one by one, with all of their shadows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.lights.spherical_triangles import TriangleLights
from relume.math.spherical_harmonics import NUM_HARMONICS

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MAX_RESIDUAL_FRACTION = 0.03  # of all light: what neither harmonics nor triangles tell
_NUM_ROUNDS = 8
_MIN_DIFFERENCE_FRACTION = 0.003  # of the mean triangle's light: differences below it count as squares
_DAMPING = 1e-6


class FrequencySplit(NamedTuple):
    """Light of M triangles.

    Attributes:
        low_frequency: coefficients of its smooth part. (NUM_HARMONICS, 3) float32
        residual_triangles: triangles that differ from it. (N,) intp
        residual: these, with what they differ by, below nothing too.
    """

    low_frequency: F32
    residual_triangles: NDArray[np.intp]
    residual: TriangleLights


def split_frequencies(lights: TriangleLights, basis: F64) -> FrequencySplit:
    """Divide light into what is smooth and the triangles that differ from that.

    Args:
        lights: M triangles. basis: what they bring in light that is a harmonic. (M, NUM_HARMONICS)
    Returns:
        As few triangles as leave `_MAX_RESIDUAL_FRACTION` of all light or less untold.
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
    """What is left of some sizes (n,) without the first 0, 1, … n of them. (n + 1,)"""
    return np.asarray(np.concatenate([np.cumsum(sizes[::-1])[::-1], [0.0]]))


def _fit_harmonics(basis: F64, light: F64, total: float) -> F64:
    """Make Σ |light − basis · c| small, by least squares whose weights follow the differences. (harmonics, 3)"""
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
