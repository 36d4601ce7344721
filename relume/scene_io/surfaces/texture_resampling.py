"""Resampling of a material's textures to a common size, for operations per texel."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import PIL.Image
from jaxtyping import Shaped
from numpy.typing import NDArray

U8 = NDArray[np.uint8]
Wrap = tuple[str, str]
NOISE = 2  # variation that lossy compression adds to a uniform image


class Raster:
    """Images by name, with the size and wrap mode of the first; missing ones are white and opaque.

    Args:
        images: pixels and wrap modes. min_size: height and width that tiled images need.
    """

    def __init__(self, images: Mapping[str, tuple[U8, Wrap]], min_size: tuple[int, int] = (0, 0)) -> None:
        self._images = {key: pixels for key, (pixels, _) in images.items()}
        first, self.wrap = next(iter(images.values()), (np.zeros((0, 0, 4), np.uint8), ("repeat", "repeat")))
        self._height, self._width = (
            max(int(extent), min_extent) for extent, min_extent in zip(first.shape, min_size, strict=False)
        )
        self.empty = not images
        self._channels: dict[tuple[str, int], U8] = {}

    @property
    def size(self) -> tuple[int, int]:
        """Common height and width."""
        return self._height, self._width

    def rgb(self, key: str) -> Shaped[U8, "height width 3"]:
        """Colors of an image; one white texel if it is missing."""
        return self.pixels(key)[..., :3]

    def channel(self, key: str, channel: int) -> Shaped[U8, "height width 1"]:
        """One channel of an image; one texel if it is uniform or missing."""
        if (key, channel) not in self._channels:
            values = self.pixels(key)[..., channel, None]
            uniform = np.full((1, 1, 1), round(float(values.mean())), np.uint8)
            self._channels[key, channel] = values if np.ptp(values) > NOISE else uniform
        return self._channels[key, channel]

    def mean(self, key: str, channel: int) -> float:
        """Mean of a channel in [0, 1]; 1 if the image is missing."""
        return float(self._images[key][..., channel].mean()) / 255 if key in self._images else 1.0

    def varies(self, key: str, channel: int) -> bool:
        """True if a channel varies by more than compression noise."""
        return key in self._images and bool(np.ptp(self._images[key][..., channel]) > NOISE)

    def pixels(self, key: str) -> Shaped[U8, "height width 4"]:
        """RGBA of an image; one white texel if it is missing."""
        if key not in self._images:
            return np.full((1, 1, 4), 255, np.uint8)
        pixels = self._images[key]
        if pixels.shape[:2] != self.size:
            # channel by channel: Pillow would multiply colors by alpha
            channels = [PIL.Image.fromarray(np.ascontiguousarray(pixels[..., k])) for k in range(4)]
            scaled = [c.resize(self.size[::-1], PIL.Image.Resampling.BILINEAR) for c in channels]
            self._images[key] = np.stack([np.asarray(c) for c in scaled], axis=-1)
        return self._images[key]
