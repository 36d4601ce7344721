"""Images of an export: named once, and computed only while they are written."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import numpy as np
import PIL.Image
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.image_io.write_image import png_bytes
from relume.scene.model import Texture
from relume.scene.texture_encoding import decode, encode_rows
from relume.scene_io.gltf.cameras import make_slug
from relume.scene_io.surfaces.surface_images import ImageInput

U8 = NDArray[np.uint8]
F64 = NDArray[np.float64]
MakePixels = Callable[[], Shaped[U8, "height width channels"]]
_ROUNDING = 1e-5  # of colors of terms


class ExportImages:
    """The images of one export; equal ones of several materials or looks are one file."""

    def __init__(self) -> None:
        self._names: dict[str, int] = {}
        self._files: dict[Hashable, str] = {}
        self._make: dict[str, MakePixels] = {}

    def add(self, preferred: str, key: Hashable, make_pixels: MakePixels) -> str:
        """Return the file name of an image.

        Args:
            preferred: for its name. key: equal for equal pixels. make_pixels: returns bytes as in the file.
        """
        if key not in self._files:
            self._files[key] = f"{make_slug(preferred, self._names)}.png"
            self._make[self._files[key]] = make_pixels
        return self._files[key]

    def pixels(self, file: str) -> Shaped[U8, "height width channels"]:
        """Compute the bytes of an image: gray, RGB or RGBA."""
        return self._make[file]()

    def png(self, file: str) -> bytes:
        """Compute the content of a file."""
        pixels = np.ascontiguousarray(self.pixels(file))
        return png_bytes(pixels[..., 0] if pixels.shape[-1] == 1 else pixels)


def color_image(images: ExportImages, name: str, texture: Texture, factor: F64) -> ImageInput:
    """Add the image of a texture times a factor; values above 1 are clamped.

    Args:
        images: gets the image, with the bytes of the texture if possible. name: preferred.
        texture: colors of any encoding. factor: multiplies its values.
    """
    if texture.encoding is not None and (scale := factor * texture.encoding.scale).max() <= 1 + _ROUNDING:
        file = images.add(name, ("bytes", id(texture)), lambda: texture.pixels)
        return ImageInput(file, is_srgb=True, factor=rgb(np.minimum(scale, 1)), wrap=texture.wrap)

    def values(rows: slice) -> NDArray[np.float32]:
        return np.asarray(decode(texture.pixels[rows], texture.encoding) * factor, np.float32)

    def make_pixels() -> U8:
        return encode_rows(values, texture.pixels.shape[:2], np.ones(3), texture.wrap).pixels

    return ImageInput(images.add(name, ("color", id(texture), *factor), make_pixels), is_srgb=True, wrap=texture.wrap)


def resized(pixels: Shaped[NDArray[Any], "height width channels"], size: tuple[int, ...]) -> NDArray[Any]:
    """Scale an image of bytes or floats, channel by channel, to a height and width."""
    if pixels.shape[:2] == size:
        return pixels
    numbers = pixels if pixels.dtype == np.uint8 else pixels.astype(np.float32)
    channels = (PIL.Image.fromarray(np.ascontiguousarray(numbers[..., k])) for k in range(pixels.shape[2]))
    bilinear = PIL.Image.Resampling.BILINEAR
    return np.stack([np.asarray(channel.resize((size[1], size[0]), bilinear)) for channel in channels], axis=-1)


def rgb(values: NDArray[Any]) -> tuple[float, float, float]:
    """Three rounded numbers."""
    red, green, blue = (round(float(value), 6) for value in values)
    return red, green, blue
