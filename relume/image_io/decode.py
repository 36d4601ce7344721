"""Decoder for PNG, JPEG and WebP from untrusted sources: the header's size is checked before decoding."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TypeVar

import numpy as np
import PIL.Image
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]
Scalar = TypeVar("Scalar", bound=np.generic)
MAX_SIDE = 8_192
MAX_TEXELS = 1_000_000_000  # of all images of a scene together, counted per decoding
MAX_JPEG_SCANS = 200  # each scan of a progressive JPEG costs a pass over all texels
FORMATS = ("PNG", "JPEG", "WEBP")


class Decoder:
    """Decoder of images that share one texel budget."""

    def __init__(self) -> None:
        self._remaining_texels = MAX_TEXELS

    def decode(self, data: bytes, label: str) -> Shaped[U8, "height width 4"]:
        """Decode an image to RGBA.

        Raises:
            SceneError: the image is too large, damaged, or of another format than PNG, JPEG and WebP.
        """
        return self._decode(data, label, _rgba)

    def decode_gray(self, data: bytes, label: str) -> Shaped[F32, "height width"]:
        """Decode an image to its luma in [0, 1], with all 16 bits of a gray image. Raises SceneError as `decode`."""
        return self._decode(data, label, _gray)

    def _decode(
        self, data: bytes, label: str, convert: Callable[[PIL.Image.Image], NDArray[Scalar]]
    ) -> NDArray[Scalar]:
        if data.startswith(b"\xff\xd8") and data.count(b"\xff\xda") > MAX_JPEG_SCANS:
            raise SceneError(f"{label} is a JPEG of more than {MAX_JPEG_SCANS} scans; save it again")
        try:
            with PIL.Image.open(io.BytesIO(data), formats=FORMATS) as image:
                self._check_size(*image.size, label)
                return convert(image)
        except SceneError:
            raise
        except (PIL.Image.DecompressionBombError, PIL.Image.DecompressionBombWarning):
            raise SceneError(f"{label} is too large; at most {MAX_SIDE}×{MAX_SIDE} is read, scale it down") from None
        except Exception:  # decoders raise many kinds for damaged data (OSError, SyntaxError, struct.error …)
            raise SceneError(f"{label} is damaged, or its format is not supported; save it as PNG") from None

    def _check_size(self, width: int, height: int, label: str) -> None:
        if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
            raise SceneError(f"{label} is {width}×{height}; at most {MAX_SIDE}×{MAX_SIDE} is read, scale it down")
        self._remaining_texels -= width * height
        if self._remaining_texels < 0:
            raise SceneError(f"the scene's images have more than {MAX_TEXELS:,} texels together; scale them down")


def _rgba(image: PIL.Image.Image) -> U8:
    """Convert to 8-bit RGBA, not premultiplied; 16-bit gray is scaled."""
    if image.mode.startswith("I"):
        gray = np.clip(np.asarray(image, np.int64) // 257, 0, 255).astype(np.uint8)
        return np.stack([gray, gray, gray, np.full_like(gray, 255)], axis=-1)
    return np.asarray(image.convert("RGBA"), np.uint8)


def _gray(image: PIL.Image.Image) -> F32:
    if image.mode.startswith("I"):
        return np.asarray(np.clip(np.asarray(image, np.float32) / 65535, 0, 1), np.float32)
    return np.asarray(np.asarray(image.convert("L"), np.float32) / 255, np.float32)
