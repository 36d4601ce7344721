"""Reading of one image of a measured BTF: checked before decoding, linear, scaled to the allowed number of texels."""

from __future__ import annotations

import io
import math

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from PIL import Image

from relume.assets.btf.compress import MAX_TEXELS
from relume.assets.btf.value_cache import MAX_VALUE
from relume.core.color import srgb_decode
from relume.core.errors import MaterialError, SceneError
from relume.image_io.downsample import downsample
from relume.image_io.read_linear import EXR_MAGIC, read_pixels

F32 = NDArray[np.float32]

SUFFIXES = (".jpg", ".jpeg", ".png", ".exr")
_MAX_PIXELS = 2048 * 2048
_FORMATS = ("JPEG", "PNG")
_DEEP_MODES = ("I", "F")  # prefixes of modes with 16 or 32 bits, which conversion would truncate to 8
_BOMB_ERRORS = Image.DecompressionBombError, Image.DecompressionBombWarning
_READ_ERRORS = OSError, ValueError, SyntaxError, RuntimeError, NotImplementedError


def read_photograph(data: bytes, name: str) -> Shaped[F32, "height width 3"]:
    """Decode a JPEG or PNG with 8-bit sRGB channels, or an OpenEXR file, which is linear.

    Args:
        data: contents of the file. name: name in messages.
    Returns:
        Finite values from 0 to `relume.assets.btf.value_cache.MAX_VALUE`.
    Raises:
        MaterialError: damaged, too large, JPEG or PNG with more than 8 bits, or values that are not finite.
    """
    return _linear(data, name) if data.startswith(EXR_MAGIC) else _srgb(data, name)


def limit_texels(image: Shaped[F32, "height width 3"], max_texels: int) -> Shaped[F32, "rows columns 3"]:
    """Scale an image down to at most `max_texels`, by means of whole blocks of pixels.

    Args:
        image: linear. max_texels: see `relume.assets.btf.compress.max_texels`.
    """
    height, width = image.shape[:2]
    factor = math.ceil(math.sqrt(height * width / max_texels))
    return downsample(image, (max(width // factor, 1), max(height // factor, 1)))


def _linear(data: bytes, name: str) -> F32:
    try:
        image, warnings = read_pixels(data, ".exr", name, lambda width, height: _check_size(width, height, name))
    except SceneError as error:
        raise MaterialError(str(error)) from error
    for warning in warnings:
        if warning.severity != "ignored":  # a measurement is not repaired
            raise MaterialError(f"{name} {warning.rstrip('.')}; repair it, and pack it again")
    if np.isnan(image).any():
        raise MaterialError(f"{name} has non-finite values; repair it, and pack it again")
    return np.clip(image, 0, MAX_VALUE)


def _srgb(data: bytes, name: str) -> F32:
    try:
        with Image.open(io.BytesIO(data), formats=_FORMATS) as image:
            _check_size(image.width, image.height, name)
            if image.mode.startswith(_DEEP_MODES):
                raise MaterialError(
                    f"{name} has more than 8 bits per channel; write it with 8 bits as sRGB, or as linear OpenEXR"
                )
            pixels = np.asarray(image.convert("RGB"))
    except MaterialError:
        raise
    except _BOMB_ERRORS as error:
        raise _size_error(name) from error
    except _READ_ERRORS as error:
        raise MaterialError(f"{name} cannot be read as an image; write it as JPEG, PNG or OpenEXR") from error
    return np.asarray(srgb_decode(pixels.astype(np.float32) / np.float32(255)), np.float32)


def _check_size(width: int, height: int, name: str) -> None:
    if width * height > _MAX_PIXELS:
        raise _size_error(name)


def _size_error(name: str) -> MaterialError:
    return MaterialError(
        f"{name} has more than {_MAX_PIXELS:,} pixels; scale the images down, at most {MAX_TEXELS:,} texels are used"
    )
