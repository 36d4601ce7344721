"""What a term's mirrorings make known of its tables: of those only the rest is made."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import NUM_FUNCTIONS, ladder

F64 = NDArray[np.float64]


def all_around(quarter: F64) -> F64:
    """Find the out-factors of a mirrored term all around from those of a quarter.

    Args:
        quarter: for φo from 0 to π/2, both ends among them. (rows, columns / 4 + 1, channels, K)
    Returns:
        For φo from 0 to 2π, the end not among them. (rows, columns, channels, K)
    """
    rungs = ladder()
    across, along = np.ones((2, NUM_FUNCTIONS))  # signs of the functions where x and where y is turned about
    across[rungs.cosine] = (-1.0) ** rungs.order
    odd = rungs.order > 0
    across[rungs.sine[odd]] = -((-1.0) ** rungs.order[odd])
    along[rungs.sine[odd]] = -1
    half = np.concatenate([quarter, across * quarter[:, -2::-1]], axis=1)
    return np.concatenate([half, along * half[:, -2:0:-1]], axis=1)
