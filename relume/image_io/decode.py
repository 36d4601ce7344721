"""Decoder for images from untrusted sources: the header's size is checked before decoding.

PNG, JPEG and WebP are decoded by Pillow; BMP, GIF, TIFF and Targa, which older programs write, by OpenImageIO.
"""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
import OpenImageIO as oiio  # noqa: N813  (the name its own documentation gives it)
import PIL.Image
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.image_io.read_linear import check_claim

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]
Scalar = TypeVar("Scalar", bound=np.generic)
MAX_SIDE = 8_192
MAX_TEXELS = 1_000_000_000  # of all images of a scene together, counted per decoding
MAX_JPEG_SCANS = 200  # each scan of a progressive JPEG costs a pass over all texels
FORMATS = ("PNG", "JPEG", "WEBP")
OTHER_FORMATS = {b"BM": ".bmp", b"GIF8": ".gif", b"II*\0": ".tif", b"MM\0*": ".tif"}
TARGA_KINDS = (1, 2, 3, 9, 10, 11)  # with a palette, in color or gray; plain or with run lengths


class Decoder:
    """Decoder of images that share one texel budget."""

    def __init__(self) -> None:
        self._remaining_texels = MAX_TEXELS

    def decode(self, data: bytes, label: str) -> Shaped[U8, "height width 4"]:
        """Decode an image to RGBA.

        Raises:
            SceneError: the image is too large, damaged, or of an unknown format.
        """
        suffix = find_suffix(data)
        if suffix:
            return _decode_other(data, suffix, label, lambda width, height: self._check_size(width, height, label))
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


def find_suffix(data: bytes) -> str:
    """The suffix of an image that OpenImageIO decodes, by its first bytes; empty for others."""
    suffix = next((suffix for magic, suffix in OTHER_FORMATS.items() if data.startswith(magic)), "")
    is_targa = len(data) > 18 and data[1] in (0, 1) and data[2] in TARGA_KINDS and data[16] in (8, 15, 16, 24, 32)
    return suffix or (".tga" if is_targa else "")


def _decode_other(data: bytes, suffix: str, label: str, check_size: Callable[[int, int], None]) -> U8:
    """Decode an image of 8 or 16 bits with OpenImageIO, from a private temporary file."""
    handle, path = tempfile.mkstemp(suffix=suffix)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        options = oiio.ImageSpec()
        options.attribute("oiio:UnassociatedAlpha", 1)
        image = oiio.ImageInput.open(path, options)
        if image is None:
            oiio.geterror()
            raise SceneError(f"{label} is damaged, or its format is not supported; save it as PNG")
        try:
            return _read_bytes(image, data, label, check_size)
        finally:
            image.close()
    except UnicodeDecodeError:  # names in the header that are not valid text
        raise SceneError(f"{label} is damaged; save it as PNG") from None
    finally:
        Path(path).unlink()


def _read_bytes(image: oiio.ImageInput, data: bytes, label: str, check_size: Callable[[int, int], None]) -> U8:
    spec = image.spec()
    if min(spec.width, spec.height) < 1:
        raise SceneError(f"{label} is damaged, or its format is not supported; save it as PNG")
    check_size(spec.width, spec.height)
    if spec.depth != 1 or not 1 <= spec.nchannels <= 4 or str(spec.format) in ("half", "float", "double"):
        raise SceneError(f"{label} has {spec.nchannels} channels of {spec.format}; save it as PNG")
    check_claim(spec.width * spec.height * spec.nchannels, data, label)
    check_claim(max(spec.tile_width, 1) * max(spec.tile_height, 1) * spec.nchannels * 4, data, label)
    pixels = image.read_image(0, 0, 0, spec.nchannels, oiio.UINT8)
    if pixels is None:
        image.geterror()
        raise SceneError(f"{label} ends early or is damaged; save it as PNG")
    colors = np.asarray(pixels, np.uint8).reshape(spec.height, spec.width, spec.nchannels)
    has_alpha = spec.nchannels in (2, 4)
    alpha = colors[..., -1:] if has_alpha else np.full((*colors.shape[:2], 1), 255, np.uint8)
    rgb = colors[..., :3] if spec.nchannels > 2 else np.repeat(colors[..., :1], 3, axis=-1)
    return np.concatenate([rgb, alpha], axis=-1)
