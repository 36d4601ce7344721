"""Downsampling of baked images: averages of linear radiance over each new pixel's area."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from PIL import Image


def downsample(
    image: Shaped[NDArray[np.float32], "height width channels"], size: tuple[int, int]
) -> Shaped[NDArray[np.float32], "new_height new_width channels"]:
    """Downsample an image with a box filter.

    Args:
        image: linear radiance.
        size: new width and height, neither larger than the image's.
    """
    if size == (image.shape[1], image.shape[0]):
        return image
    channels = [Image.fromarray(np.ascontiguousarray(image[..., c])) for c in range(image.shape[2])]
    return np.stack([np.asarray(c.resize(size, Image.Resampling.BOX), np.float32) for c in channels], axis=-1)
