"""What a term's mirrorings make known of its tables: of those only the rest is made."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.math.zernike import NUM_FUNCTIONS, recurrence

F64 = NDArray[np.float64]


def expand_quarter(quarter: F64) -> F64:
    """Find the out-factors of a mirrored term all around from those of a quarter.

    Args:
        quarter: for φo from 0 to π/2, both ends among them. (rows, columns / 4 + 1, channels, K)
    Returns:
        For φo from 0 to 2π, the end not among them. (rows, columns, channels, K)
    """
    recurrence_table = recurrence()
    across, along = np.ones((2, NUM_FUNCTIONS))  # signs of the functions where x and where y is turned about
    across[recurrence_table.cosine] = (-1.0) ** recurrence_table.order
    odd = recurrence_table.order > 0
    across[recurrence_table.sine[odd]] = -((-1.0) ** recurrence_table.order[odd])
    along[recurrence_table.sine[odd]] = -1
    half = np.concatenate([quarter, across * quarter[:, -2::-1]], axis=1)
    return np.concatenate([half, along * half[:, -2:0:-1]], axis=1)
