"""Several images of one material brought to one size, so that they can be combined texel by texel."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import PIL.Image

from relume.scene.gltf.images import F32, U8

Wrap = tuple[str, str]


class Raster:
    """Images by name, all in the size and with the wrap of the first; those that are missing are white and opaque."""

    def __init__(self, images: Mapping[str, tuple[U8, Wrap]]) -> None:
        self._images = {key: pixels for key, (pixels, _) in images.items()}
        first, self.wrap = next(iter(images.values()), (np.zeros((0, 0, 4), np.uint8), ("repeat", "repeat")))
        self._height, self._width = int(first.shape[0]), int(first.shape[1])
        self.empty = not images

    @property
    def num_texels(self) -> int:
        """The number of texels of an image."""
        return self._height * self._width

    def rgb(self, key: str) -> U8:
        """(height, width, 3); (1, 1, 3) white where there is no such image."""
        return self._resized(key)[..., :3]

    def channel(self, key: str, channel: int) -> F32:
        """One channel in [0, 1]. (height, width, 1); (1, 1, 1) where it does not vary, 1 where there is no image."""
        values = self._resized(key)[..., channel, None]
        values = values if np.ptp(values) > 0 else values[:1, :1]
        return values.astype(np.float32) / np.float32(255)

    def mean(self, key: str, channel: int) -> float:
        """Mean of a channel in [0, 1]; 1 where there is no such image."""
        return float(self._images[key][..., channel].mean()) / 255 if key in self._images else 1.0

    def varies(self, key: str, channel: int) -> bool:
        """Whether a channel differs from texel to texel by more than the noise of its coding."""
        return key in self._images and bool(np.ptp(self._images[key][..., channel]) > 2)

    def _resized(self, key: str) -> U8:
        if key not in self._images:
            return np.full((1, 1, 4), 255, np.uint8)
        pixels = self._images[key]
        if pixels.shape[:2] == (self._height, self._width):
            return pixels
        # Channel by channel: Pillow would multiply colours by alpha
        channels = [PIL.Image.fromarray(np.ascontiguousarray(pixels[..., k])) for k in range(4)]
        size = (self._width, self._height)
        return np.stack([np.asarray(c.resize(size, PIL.Image.Resampling.BILINEAR)) for c in channels], axis=-1)
