"""The environment model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning


@dataclass(frozen=True)
class Environment:
    """Distant light: equirectangular linear radiance, top row first.

    Direction of texel (u, v), v from the top: u = atan2(z, x)/2π + ½, v = ½ − asin(y)/π.

    Attributes:
        radiance: finite, not negative.
        warnings: warnings about repairs during import, one sentence each.
    """

    name: str
    radiance: Shaped[NDArray[np.float32], "height width 3"]
    warnings: tuple[ImporterWarning, ...] = ()
