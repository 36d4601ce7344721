"""Decoder for images from untrusted sources: the header's size is checked before decoding.

PNG, JPEG and WebP are decoded by Pillow; BMP, DDS, GIF, TIFF and Targa by OpenImageIO.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

import numpy as np
import OpenImageIO as oiio  # noqa: N813  (the name its own documentation gives it)
import PIL.Image
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.image_io.open_image import check_claim, clear_error, open_image
from relume.image_io.orientation import orient

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]
Scalar = TypeVar("Scalar", bound=np.generic)
MAX_SIDE = 8_192
MAX_TEXELS = 1_000_000_000  # of all images of a scene together, counted per decoding
MAX_JPEG_SCANS = 200  # each scan of a progressive JPEG costs a pass over all texels
FORMATS = ("PNG", "JPEG", "WEBP")
KTX2 = b"\xabKTX 20\xbb"
OTHER_FORMATS = {b"BM": ".bmp", b"DDS ": ".dds", b"GIF8": ".gif", b"II*\0": ".tif", b"MM\0*": ".tif"}
LUMA = np.array([0.299, 0.587, 0.114], np.float32)  # ITU-R BT.601, as Pillow has it
_EXIF_ORIENTATION = 274
TARGA_KINDS = (1, 2, 3, 9, 10, 11)  # with a palette, in color or gray; plain or with run lengths


class Decoder:
    """Decoder of images that share one texel budget."""

    def __init__(self, *, applies_orientation: bool = True) -> None:
        """
        Args:
            applies_orientation: whether images are turned as their metadata say.
        """
        self._remaining_texels, self._applies_orientation = MAX_TEXELS, applies_orientation

    def decode(self, data: bytes, label: str) -> Shaped[U8, "height width 4"]:
        """Decode an image to RGBA.

        Raises:
            SceneError: the image is too large, damaged, or of an unknown format.
        """
        if suffix := find_suffix(data):
            return _expand_to_rgba(self._decode_other(data, suffix, label, oiio.UINT8))
        return self._decode(data, label, _rgba)

    def decode_gray(self, data: bytes, label: str) -> Shaped[F32, "height width"]:
        """Decode an image to its luma in [0, 1], with all 16 bits of a gray image. Raises SceneError as `decode`."""
        if suffix := find_suffix(data):
            values = self._decode_other(data, suffix, label, oiio.FLOAT)
            return np.asarray(values[..., :3] @ LUMA if values.shape[2] > 2 else values[..., 0], np.float32)
        return self._decode(data, label, _gray)

    def _decode(
        self, data: bytes, label: str, convert: Callable[[PIL.Image.Image], NDArray[Scalar]]
    ) -> NDArray[Scalar]:
        if data.startswith(KTX2):
            raise SceneError(f"{label} is a KTX2 image; save it as PNG (ktx extract in.ktx2 out.png)")
        if data.startswith(b"\xff\xd8") and data.count(b"\xff\xda") > MAX_JPEG_SCANS:
            raise SceneError(f"{label} is a JPEG of more than {MAX_JPEG_SCANS} scans; save it again")
        try:
            with _no_metadata_warnings(), PIL.Image.open(io.BytesIO(data), formats=FORMATS) as image:
                self._check_size(*image.size, label)
                return self._orient(convert(image), _exif_orientation(image))
        except SceneError:
            raise
        except (PIL.Image.DecompressionBombError, PIL.Image.DecompressionBombWarning):
            raise SceneError(f"{label} is too large; at most {MAX_SIDE}×{MAX_SIDE} is read, scale it down") from None
        except Exception:  # decoders raise many kinds for damaged data (OSError, SyntaxError, struct.error …)
            raise SceneError(f"{label} is damaged, or its format is not supported; save it as PNG") from None

    def _decode_other(
        self, data: bytes, suffix: str, label: str, dtype: oiio.BASETYPE
    ) -> Shaped[NDArray[Any], "height width channels"]:
        """Decode an image of 8 or 16 bits with OpenImageIO. Returns 1 to 4 channels: gray or colors, and alpha."""
        options = oiio.ImageSpec()
        options.attribute("oiio:UnassociatedAlpha", 1)
        with open_image(data, suffix, label, options) as image:
            spec = image.spec()
            self._check_size(spec.width, spec.height, label)
            if spec.depth != 1 or str(spec.format) in ("half", "float", "double"):
                raise SceneError(f"{label} is a volume or has texels of {spec.format}; save it as PNG")
            num_channels = min(spec.nchannels, 4)
            check_claim(spec.width * spec.height * spec.nchannels, data, label)
            check_claim(max(spec.tile_width, 1) * max(spec.tile_height, 1) * spec.nchannels * 4, data, label)
            pixels = image.read_image(0, 0, 0, num_channels, dtype)
            if pixels is None:
                clear_error(image.geterror)
                raise SceneError(f"{label} ends early or is damaged; save it as PNG")
            values = np.asarray(pixels).reshape(spec.height, spec.width, num_channels)
            return self._orient(values, spec.get_int_attribute("Orientation", 1))

    def _orient(self, values: NDArray[Scalar], orientation: int) -> NDArray[Scalar]:
        return orient(values, orientation) if self._applies_orientation else values

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


@contextmanager
def _no_metadata_warnings() -> Iterator[None]:
    """Let Pillow ignore damaged metadata, which does not cost the image."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


def _exif_orientation(image: PIL.Image.Image) -> int:
    with suppress(Exception):
        return int(image.getexif().get(_EXIF_ORIENTATION, 1))
    return 1


def _expand_to_rgba(values: U8) -> U8:
    """Expand gray, gray and alpha, or RGB to RGBA. Alpha is none if zero everywhere: BMP and Targa reserve its byte."""
    num_channels = values.shape[2]
    rgb = values[..., :3] if num_channels > 2 else np.repeat(values[..., :1], 3, axis=-1)
    has_alpha = num_channels in (2, 4) and values[..., -1].any()
    alpha = values[..., -1:] if has_alpha else np.full((*values.shape[:2], 1), 255, np.uint8)
    return np.concatenate([rgb, alpha], axis=-1)
