"""Images as inputs of surface models, and their pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_encode
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, unsupported
from relume.image_io.decode import U8, Decoder
from relume.scene.texture_encoding import SRGB_TO_LINEAR
from relume.scene_io.gltf.uvs import UvTransform

CHANNELS = "rgba"
_CACHE_BYTES = 300_000_000  # of decoded images, which other materials may use
_TO_LINEAR = np.rint(255 * SRGB_TO_LINEAR).astype(np.uint8)
_TO_SRGB = np.rint(255 * srgb_encode((np.arange(256) / 255).astype(np.float32))).astype(np.uint8)


@dataclass(frozen=True)
class ImageInput:
    """An image times a factor.

    Attributes:
        file: as the document names it.
        channel: "r", "g", "b" or "a" of a number; "rgb" of a color or a normal.
        is_srgb: colors are in sRGB, otherwise linear. Alpha is always linear.
        factor: multiplies the values; of a number, three equal ones.
        wrap: as in `relume.scene.model.Texture`. transform: of UV coordinates with v from the top, as in glTF.
        default: value if the file is missing; None for the default of the surface's input.
    """

    file: str
    channel: str = "rgb"
    is_srgb: bool = False
    factor: tuple[float, float, float] = (1.0, 1.0, 1.0)
    wrap: tuple[str, str] = ("repeat", "repeat")
    transform: UvTransform = field(default_factory=UvTransform)
    default: tuple[float, float, float] | None = None


class SurfaceImages:
    """Decodes the images of one document, with a cache; an image that cannot be used is one warning.

    Args:
        read: returns a file by its name in the document and its label for messages; None, with a warning, if it is
            missing. warnings: gets a sentence for each image that is damaged.
    """

    def __init__(self, read: Callable[[str, str], bytes | None], warnings: list[ImporterWarning]) -> None:
        self._read, self._warnings = read, warnings
        self._decoder = Decoder()
        self._pixels: dict[str, U8 | None] = {}

    def pixels(self, file: str, label: str) -> Shaped[U8, "height width 4"] | None:
        """RGBA of a file as it is; None if it cannot be used.

        Args:
            file: name in the document. label: names the image in messages, such as "base color of …".
        """
        if file in self._pixels:
            self._pixels[file] = self._pixels.pop(file)  # most recently used last
        else:
            self._pixels[file] = self._decode(file, label)
            while (
                len(self._pixels) > 1 and sum(p.nbytes for p in self._pixels.values() if p is not None) > _CACHE_BYTES
            ):
                del self._pixels[next(iter(self._pixels))]
        return self._pixels[file]

    def mean(self, image: ImageInput, label: str) -> NDArray[np.float64]:
        """Mean of an image that can be used: three linear numbers."""
        pixels = self.pixels(image.file, label)
        assert pixels is not None
        if image.channel != "rgb":
            return np.full(3, scalar_bytes(pixels, image).mean() / 255 * image.factor[0])
        values = SRGB_TO_LINEAR if image.is_srgb else (np.arange(256) / 255).astype(np.float32)
        counts = [np.bincount(pixels[..., k].ravel(), minlength=256) for k in range(3)]
        return np.asarray(np.array(counts) @ values / counts[0].sum() * np.array(image.factor))

    def _decode(self, file: str, label: str) -> U8 | None:
        try:
            data = self._read(file, label)
            return None if data is None else self._decoder.decode(data, label)
        except SceneError as error:
            self._warnings.append(unsupported(f"Left out the {label}: {error}."))
            return None


def scalar_bytes(pixels: Shaped[U8, "height width 4"], image: ImageInput) -> Shaped[U8, "height width"]:
    """The channel of a number, linear; red of an image without one."""
    channel = CHANNELS.index(image.channel[0])
    values = pixels[..., channel]
    return np.asarray(_TO_LINEAR[values] if image.is_srgb and channel < 3 else values)


def color_bytes(pixels: Shaped[U8, "height width 4"], image: ImageInput) -> Shaped[U8, "height width 3"]:
    """Colors in sRGB; gray of an image with one channel."""
    colors = (
        pixels[..., :3] if image.channel == "rgb" else np.repeat(scalar_bytes(pixels, image)[..., None], 3, axis=-1)
    )
    is_srgb = image.is_srgb and image.channel == "rgb"
    return np.asarray(colors if is_srgb else _TO_SRGB[colors])
