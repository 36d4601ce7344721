"""Completes tables of coefficients by a term's reflection symmetries."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.math.zernike import NUM_FUNCTIONS, recurrence

F64 = NDArray[np.float64]


def expand_quarter(quarter: Shaped[F64, "rows quarter_columns channels K"]) -> Shaped[F64, "rows columns channels K"]:
    """Return the outgoing coefficients of a reflection-symmetric term for all φo from those of a quadrant.

    Args:
        quarter: for φo from 0 to π/2, both included.
    Returns:
        For φo from 0 to 2π, end excluded: four times as many columns less the repeated ones.
    """
    recurrence_table = recurrence()
    across, along = np.ones((2, NUM_FUNCTIONS))  # signs of the functions under x → −x and y → −y
    across[recurrence_table.cosine] = (-1.0) ** recurrence_table.order
    odd = recurrence_table.order > 0
    across[recurrence_table.sine[odd]] = -((-1.0) ** recurrence_table.order[odd])
    along[recurrence_table.sine[odd]] = -1
    half = np.concatenate([quarter, across * quarter[:, -2::-1]], axis=1)
    return np.concatenate([half, along * half[:, -2:0:-1]], axis=1)
