"""What bytes of textures stand for: a fifth of the memory that values would take, decoded where they are looked up."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.core.color import srgb_decode, srgb_encode
from relume.scene.model import Texture, TextureEncoding

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

ROWS_PER_BATCH = 256  # that are decoded together: a whole image of 8,192² would be 800 MB of values
SRGB_TO_LINEAR = srgb_decode((np.arange(256) / 255).astype(np.float32))
_MIN_LENGTH = np.float32(1e-3)  # of a normal that says where it points


def decode(texels: NDArray[Any], encoding: TextureEncoding | None) -> F32:
    """Find the values of texels.

    Args:
        texels: bytes; values themselves where there is no coding. (..., 3), or (..., 1) of shares
    Returns:
        Linear RGB, unit normals, or shares. Shaped like `texels`, float32
    """
    if encoding is None:
        return np.asarray(texels, np.float32)
    scale = np.array(encoding.scale, np.float32)
    if encoding.kind == "srgb":
        return np.asarray(SRGB_TO_LINEAR[texels] * scale)
    if encoding.kind == "share":
        return np.asarray(texels * (scale[:1] / np.float32(255)), np.float32)
    normals = (texels.astype(np.float32) / np.float32(127.5) - np.float32(1)) * scale
    if encoding.turn:
        c, s = np.cos(encoding.turn), np.sin(encoding.turn)
        normals[..., :2] = normals[..., :2] @ np.array([[c, -s], [s, c]], np.float32)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    unit = np.where(length > _MIN_LENGTH, normals / np.maximum(length, _MIN_LENGTH), np.array([0, 0, 1], np.float32))
    return np.asarray(unit, np.float32)


def decode_rows(texture: Texture) -> Iterator[F32]:
    """The values of a texture, some rows after others. (rows, width, 3 or 1) each"""
    for start in range(0, len(texture.pixels), ROWS_PER_BATCH):
        yield decode(texture.pixels[start : start + ROWS_PER_BATCH], texture.encoding)


def mean_value(texture: Texture) -> F64:
    """The mean value. (3,)"""
    total = sum(rows.sum(axis=(0, 1), dtype=np.float64) for rows in decode_rows(texture))
    return np.asarray(total / (texture.pixels.shape[0] * texture.pixels.shape[1]))


def encode_rows(
    values: Callable[[slice], F32], size: tuple[int, int], max_value: F64, wrap: tuple[str, str]
) -> Texture:
    """Make a texture of values that are computed some rows at a time.

    Args:
        values: of rows, (rows, width, 3); or one of all texels that are alike. size: height and width.
        max_value: no value is above. (3,) wrap: of the texture.
    """
    pixels = np.empty((*size, 3), np.uint8)
    scale = np.maximum(max_value, 1e-6)
    for start in range(0, size[0], ROWS_PER_BATCH):
        rows = slice(start, start + ROWS_PER_BATCH)
        normalized = np.asarray(values(rows) / scale, np.float32)
        pixels[rows] = np.round(np.float32(255) * srgb_encode(normalized))
    red, green, blue = scale.tolist()
    return Texture(pixels, wrap, TextureEncoding("srgb", (red, green, blue)))


def periodic(index: NDArray[np.float64], size: int, wrap: str) -> NDArray[np.int64]:
    """Wrap texel indices into the image. Indices far outside stay exact: they are reduced in float64.

    Args:
        index: whole numbers. (n,) size: texels along the axis. wrap: see `relume.scene.model.Texture`.
    """
    if wrap == "clamp":
        return np.clip(index, 0, size - 1).astype(np.int64)
    if wrap == "mirror":
        folded = np.mod(index, 2 * size)
        return np.asarray(np.minimum(folded, 2 * size - 1 - folded), np.int64)
    return np.asarray(np.mod(index, size), np.int64)
