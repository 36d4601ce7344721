"""Contrast of the display: the slope of log radiance about middle gray.

y = g (x / g)ᶜ with the contrast c and middle gray g = 0.18, which stays. An exposure of e stops before it is one of c e
stops after it. The editor's shader computes the same.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]

NEUTRAL_CONTRAST = 1.0
CONTRASTS = (0.5, 2.0)
_MIDDLE_GRAY = np.float32(0.18)


def apply_contrast(radiance: Shaped[F32, "*shape"], contrast: float) -> Shaped[F32, "*shape"]:
    """Return radiance with a contrast; 1 / contrast undoes it.

    Args:
        radiance: linear, of any channel, not negative. contrast: in `CONTRASTS`, or the inverse of one.
    """
    return np.asarray(_MIDDLE_GRAY * (radiance / _MIDDLE_GRAY) ** np.float32(contrast))
