"""Rotation of the environment with which the lights come nearest to a target."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize_scalar

NUM_STARTS = 12
_TOLERANCE_DEG = 0.5
_MAX_STEPS = 12


def best_rotation(error: Callable[[float], float], current: float) -> float:
    """Search the rotation of the least error: a grid, then Brent's golden-section search about its best rotation.

    Args:
        error: of a rotation in degrees, with all other unknowns solved. current: rotation of the look.
    Returns:
        Degrees in [0, 360); the current rotation if no other is better.
    """
    spacing = 360.0 / NUM_STARTS
    grid = current + spacing * np.arange(NUM_STARTS)
    start = float(min(grid, key=error))  # the current one first: it wins if all are equal
    search = minimize_scalar(
        error,
        bounds=(start - spacing, start + spacing),
        method="bounded",
        options={"xatol": _TOLERANCE_DEG, "maxiter": _MAX_STEPS},
    )
    return (float(search.x) if search.fun < error(start) else start) % 360.0
