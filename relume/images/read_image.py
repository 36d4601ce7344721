"""Import of material images from untrusted sources: those of `Decoder` as bytes, OpenEXR as reflectances."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from PIL import Image

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported, with_subject
from relume.image_io.decode import Decoder
from relume.image_io.read_linear import EXR_MAGIC, read_pixels
from relume.scene.model import Texture, TextureEncoding

MAX_FILE_BYTES = 100_000_000
MAX_SIDE = 4_096


def read_image(path: Path, name: str) -> tuple[Texture, tuple[ImporterWarning, ...]]:
    """Read an image file; also return warnings about changes.

    Args:
        path: the file. name: shown to users.
    Returns:
        sRGB bytes, or reflectances in half precision, clamped to [0, 1]; without alpha.
    Raises:
        SceneError: unsupported format, damaged, or too large.
    """
    label = f"image {name!r}"
    num_bytes = path.stat().st_size
    if num_bytes > MAX_FILE_BYTES:
        raise SceneError(
            f"{label} has {num_bytes / 1e6:,.0f} MB, the limit is {MAX_FILE_BYTES / 1e6:,.0f}; scale it down"
        )
    data = path.read_bytes()
    if data.startswith(EXR_MAGIC):
        return _read_exr(data, label, f"image {quote(name)}")
    pixels = Decoder().decode(data, label)
    limited, warnings = limit_size(pixels[..., :3]), tuple[ImporterWarning, ...]()
    if limited.shape != pixels[..., :3].shape:
        sizes = [f"{array.shape[1]}×{array.shape[0]}" for array in (pixels, limited)]
        warnings = (approximated(f"Image {quote(name)} was scaled from {sizes[0]} to {sizes[1]}."),)
    if pixels[..., 3].min() < 255:
        warnings = (*warnings, approximated(f"The transparency of image {quote(name)} was ignored."))
    return Texture(np.ascontiguousarray(limited), encoding=TextureEncoding("srgb")), warnings


def limit_size(texels: Shaped[NDArray[np.uint8], "height width channels"]) -> NDArray[np.uint8]:
    """Scale an image down to at most `MAX_SIDE` texels per side, by means of whole blocks."""
    longest_side = max(texels.shape[:2])
    if longest_side <= MAX_SIDE:
        return texels
    return np.asarray(Image.fromarray(texels).reduce(-(-longest_side // MAX_SIDE)))


def _check_size(label: str, width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise SceneError(f"{label} is {width}×{height} pixels, the limit is {MAX_SIDE}×{MAX_SIDE}; scale it down")


def _read_exr(data: bytes, label: str, quoted_label: str) -> tuple[Texture, tuple[ImporterWarning, ...]]:
    pixels, predicates = read_pixels(data, ".exr", label, partial(_check_size, label))
    warnings = with_subject(quoted_label[0].upper() + quoted_label[1:], predicates)
    broken = np.isnan(pixels).any(axis=-1, keepdims=True)
    if broken.any():
        warnings.append(unsupported(f"{int(broken.sum()):,} NaN texels of {quoted_label} were made black."))
    clamped = np.clip(np.where(broken, np.float32(0), pixels), 0, 1)
    if (clamped != pixels).any(axis=-1, keepdims=True)[~broken].any():
        warnings.append(approximated(f"Values of {quoted_label} below 0 or above 1 were clamped."))
    return Texture(clamped.astype(np.float16)), tuple(warnings)
