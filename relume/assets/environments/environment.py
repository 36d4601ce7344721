"""An environment as relume sees it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning


@dataclass(frozen=True)
class Environment:
    """Distant light: equirectangular linear radiance, top row first.

    The direction of texel (u, v), v from the top: u = atan2(z, x)/2π + ½, v = ½ − asin(y)/π.

    Attributes:
        radiance: finite, not negative. (height, width, 3) float32
        warnings: what had to be repaired when it was read, one sentence each.
    """

    name: str
    radiance: NDArray[np.float32]
    warnings: tuple[ImporterWarning, ...] = ()
