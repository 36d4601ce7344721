"""Smaller pictures from baked ones: averages of linear radiance over each new pixel's area."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image


def downsample(image: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """A smaller image, each of its pixels the mean over the area that it covers.

    Args:
        image: linear radiance. (height, width, channels) float32
        size: width and height, neither larger than the image's.
    Returns:
        (size[1], size[0], channels) float32
    """
    if size == (image.shape[1], image.shape[0]):
        return image
    channels = [Image.fromarray(np.ascontiguousarray(image[..., c])) for c in range(image.shape[2])]
    return np.stack([np.asarray(c.resize(size, Image.Resampling.BOX), np.float32) for c in channels], axis=-1)
