"""Orientation of stored images: the tag of EXIF and TIFF, and the orders of Radiance."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

Scalar = TypeVar("Scalar", bound=np.generic)

TRANSPOSED = (5, 6, 7, 8)
"""Orientations whose stored rows are columns of the image."""
_FLIPPED_ROWS, _FLIPPED_COLUMNS = (3, 4, 7, 8), (2, 3, 6, 7)


def orient(
    stored: Shaped[NDArray[Scalar], "rows columns *channels"], orientation: int
) -> Shaped[NDArray[Scalar], "height width *channels"]:
    """Put the top row first and the left column first.

    Args:
        stored: texels in the order of the file.
        orientation: 1 to 8, as EXIF defines it: 1 is upright; others change nothing.
    """
    upright = stored.swapaxes(0, 1) if orientation in TRANSPOSED else stored
    upright = upright[::-1] if orientation in _FLIPPED_ROWS else upright
    return np.ascontiguousarray(upright[:, ::-1] if orientation in _FLIPPED_COLUMNS else upright)
