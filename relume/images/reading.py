"""Reads images of base colours, which may be hostile: PNG, JPEG and WebP as bytes, OpenEXR as reflectances."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from relume.errors import SceneError
from relume.imageio.decoding import Decoder
from relume.imageio.linear import EXR_MAGIC, read_pixels
from relume.remarks import Remark, simplified, wrong
from relume.scene.model import Coding, Texture

MAX_FILE_BYTES = 100_000_000
MAX_SIDE = 4_096


def read_image(path: Path, name: str) -> tuple[Texture, tuple[Remark, ...]]:
    """Read a file of an image, and say what was changed.

    Args:
        path: the file. name: what people call it.
    Returns:
        Bytes of display values, or reflectances in half precision, held to [0, 1]; alpha is left out.
    Raises:
        SceneError: none of the formats, damaged, or too large.
    """
    what = f"image {name!r}"
    num_bytes = path.stat().st_size
    if num_bytes > MAX_FILE_BYTES:
        raise SceneError(f"{what} has {num_bytes / 1e6:,.0f} MB, {MAX_FILE_BYTES / 1e6:,.0f} MB are taken; scale it")
    data = path.read_bytes()
    if data.startswith(EXR_MAGIC):
        return _of_exr(data, what)
    pixels = Decoder().decode(data, what)
    kept, said = held(pixels[..., :3]), tuple[Remark, ...]()
    if kept.shape != pixels[..., :3].shape:
        sizes = [f"{of.shape[1]}×{of.shape[0]}" for of in (pixels, kept)]
        said = (simplified(f"{what} is {sizes[0]}; it is kept as {sizes[1]}, each texel the mean of its own"),)
    if pixels[..., 3].min() < 255:
        said = (*said, simplified(f"{what} is transparent somewhere; its colours are taken as they are there"))
    return Texture(np.ascontiguousarray(kept), coding=Coding("srgb")), said


def held(texels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Hold an image to `MAX_SIDE`, each texel the mean of its own. texels: (height, width, channels)"""
    most = max(texels.shape[:2])
    if most <= MAX_SIDE:
        return texels
    return np.asarray(Image.fromarray(texels).reduce(-(-most // MAX_SIDE)))


def _check_size(what: str, width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise SceneError(f"{what} is {width}×{height}; at most {MAX_SIDE}×{MAX_SIDE} is taken, scale it down")


def _of_exr(data: bytes, what: str) -> tuple[Texture, tuple[Remark, ...]]:
    pixels = read_pixels(data, ".exr", what, partial(_check_size, what))
    said = []
    broken = ~np.isfinite(pixels).all(axis=-1, keepdims=True)
    if broken.any():
        said.append(wrong(f"{int(broken.sum()):,} texels of {what} are not finite; they are black now"))
    held = np.clip(np.where(broken, np.float32(0), pixels), 0, 1)
    if (held != pixels).any(axis=-1, keepdims=True)[~broken].any():
        said.append(simplified(f"{what} reflects less than nothing or more than all somewhere; it is held to that"))
    return Texture(held.astype(np.float16)), tuple(said)
