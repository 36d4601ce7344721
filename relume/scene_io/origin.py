"""The new origin of a scene that is far from zero: single precision would round its shape."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, ignored
from relume.scene_io.import_options import Recenter

F64 = NDArray[np.float64]
FAR = 100.0  # of its size from the origin: float32 rounds positions to 6 millionths of the size


def choose_origin(low: Shaped[F64, " 3"], high: Shaped[F64, " 3"], recenter: Recenter) -> Shaped[F64, " 3"]:
    """Return the new origin of positions, in the coordinates of the file: the middle of the scene, or zero.

    Args:
        low, high: bounding box of the scene. recenter: see `ImportOptions`.
    """
    is_far = float(np.maximum(np.abs(low), np.abs(high)).max()) > FAR * float(np.linalg.norm(high - low))
    return (low + high) / 2 if recenter == "always" or (recenter == "auto" and is_far) else np.zeros(3)


def moved_warning(origin: Shaped[F64, " 3"]) -> list[ImporterWarning]:
    """A warning about a new origin, in the coordinates of the file; none if it is zero."""
    if not origin.any():
        return []
    x, y, z = (f"{value:,.10g}" for value in origin)
    message = f"Positions are relative to ({x}; {y}; {z}) of the file: the middle of the scene."
    return [ignored(message)]
