"""Light of an environment, divided: what is smooth goes into harmonics, what these would blur stays on its triangles.

Harmonics of a whole sky with a sun in it are neither the sky nor the sun. The absolute differences of all triangles are
made as small as they get instead of their squares: then few triangles differ by much, lamps and the sun, and all others
by little. Those few are told beside the harmonics, one by one, with all of their shadows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.basis.harmonics import NUM_HARMONICS
from relume.light.triangles import TriangleLights

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MISSED = 0.03  # of all light: what neither harmonics nor triangles tell
_ROUNDS = 8
_LEAST = 0.003  # of the mean triangle's light: differences below it count as squares
_DAMPING = 1e-6


class Divided(NamedTuple):
    """Light of M triangles.

    Attributes:
        smooth: coefficients of its smooth part. (NUM_HARMONICS, 3) float32
        chosen: triangles that differ from it. (N,) intp
        beyond: these, with what they differ by, below nothing too.
    """

    smooth: F32
    chosen: NDArray[np.intp]
    beyond: TriangleLights


def divide(lights: TriangleLights, basis: F64) -> Divided:
    """Divide light into what is smooth and the triangles that differ from that.

    Args:
        lights: M triangles. basis: what they bring in light that is a harmonic. (M, NUM_HARMONICS)
    Returns:
        As few triangles as leave `_MISSED` of all light or less untold.
    """
    light = lights.irradiance.astype(np.float64)
    whole = float(np.abs(light).sum())
    if whole == 0:
        return Divided(np.zeros((NUM_HARMONICS, 3), np.float32), np.empty(0, np.intp), lights.none())
    smooth = _fitted(basis, light, whole)
    beyond = light - basis @ smooth
    size = np.abs(beyond).sum(axis=1)
    order = np.argsort(-size, kind="stable")
    left = _left_without(size[order])
    chosen = np.sort(order[: int(np.argmax(left <= _MISSED * whole))])
    return Divided(smooth.astype(np.float32), chosen, lights.some(chosen, beyond[chosen].astype(np.float32)))


def _left_without(sizes: F64) -> F64:
    """What is left of some sizes (n,) without the first 0, 1, … n of them. (n + 1,)"""
    return np.asarray(np.concatenate([np.cumsum(sizes[::-1])[::-1], [0.0]]))


def _fitted(basis: F64, light: F64, whole: float) -> F64:
    """Make Σ |light − basis · c| small, by least squares whose weights follow the differences. (harmonics, 3)"""
    least = _LEAST * whole / len(light)
    weight = np.full(len(light), 1 / least)
    found = np.zeros((basis.shape[1], light.shape[1]))
    for _ in range(_ROUNDS):
        weighed = basis * weight[:, None]
        normal = weighed.T @ basis
        normal += _DAMPING * np.trace(normal) / len(normal) * np.eye(len(normal))
        found = np.linalg.solve(normal, weighed.T @ light)
        weight = 1 / np.maximum(np.abs(light - basis @ found).sum(axis=1), least)
    return found
