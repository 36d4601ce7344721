"""Reads images of base colours, which may be hostile: PNG, JPEG and WebP as bytes, OpenEXR as reflectances."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, unsupported
from relume.image_io.decode import Decoder
from relume.image_io.read_linear import EXR_MAGIC, read_pixels
from relume.scene.model import Texture, TextureEncoding

MAX_FILE_BYTES = 100_000_000
MAX_SIDE = 4_096


def read_image(path: Path, name: str) -> tuple[Texture, tuple[ImporterWarning, ...]]:
    """Read a file of an image, and say what was changed.

    Args:
        path: the file. name: what people call it.
    Returns:
        Bytes of display values, or reflectances in half precision, held to [0, 1]; alpha is left out.
    Raises:
        SceneError: none of the formats, damaged, or too large.
    """
    label = f"image {name!r}"
    num_bytes = path.stat().st_size
    if num_bytes > MAX_FILE_BYTES:
        raise SceneError(f"{label} has {num_bytes / 1e6:,.0f} MB, {MAX_FILE_BYTES / 1e6:,.0f} MB are taken; scale it")
    data = path.read_bytes()
    if data.startswith(EXR_MAGIC):
        return _read_exr(data, label)
    pixels = Decoder().decode(data, label)
    limited, warnings = limit_size(pixels[..., :3]), tuple[ImporterWarning, ...]()
    if limited.shape != pixels[..., :3].shape:
        sizes = [f"{array.shape[1]}×{array.shape[0]}" for array in (pixels, limited)]
        warnings = (approximated(f"{label} is {sizes[0]}; it is kept as {sizes[1]}, each texel the mean of its own"),)
    if pixels[..., 3].min() < 255:
        warnings = (
            *warnings,
            approximated(f"{label} is transparent somewhere; its colours are taken as they are there"),
        )
    return Texture(np.ascontiguousarray(limited), encoding=TextureEncoding("srgb")), warnings


def limit_size(texels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Hold an image to `MAX_SIDE`, each texel the mean of its own. texels: (height, width, channels)"""
    longest_side = max(texels.shape[:2])
    if longest_side <= MAX_SIDE:
        return texels
    return np.asarray(Image.fromarray(texels).reduce(-(-longest_side // MAX_SIDE)))


def _check_size(label: str, width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise SceneError(f"{label} is {width}×{height}; at most {MAX_SIDE}×{MAX_SIDE} is taken, scale it down")


def _read_exr(data: bytes, label: str) -> tuple[Texture, tuple[ImporterWarning, ...]]:
    pixels = read_pixels(data, ".exr", label, partial(_check_size, label))
    warnings = []
    broken = ~np.isfinite(pixels).all(axis=-1, keepdims=True)
    if broken.any():
        warnings.append(unsupported(f"{int(broken.sum()):,} texels of {label} are not finite; they are black now"))
    clamped = np.clip(np.where(broken, np.float32(0), pixels), 0, 1)
    if (clamped != pixels).any(axis=-1, keepdims=True)[~broken].any():
        warnings.append(
            approximated(f"{label} reflects less than nothing or more than all somewhere; it is held to that")
        )
    return Texture(clamped.astype(np.float16)), tuple(warnings)
