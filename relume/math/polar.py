"""Unit vectors from polar angles."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def polar(theta: Shaped[F64, "*batch"], phi: Shaped[F64, "*batch"]) -> Shaped[F64, "*batch 3"]:
    """Unit vectors (sin θ cos φ, sin θ sin φ, cos θ). theta, phi: radians"""
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
