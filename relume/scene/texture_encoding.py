"""Encodings of textures as bytes, decoded at each lookup: a fifth of the memory of float values."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_decode, srgb_encode
from relume.scene.model import Texture, TextureEncoding

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

ROWS_PER_BATCH = 256  # rows to decode together; a whole image of 8,192² would take 800 MB
SRGB_TO_LINEAR = srgb_decode((np.arange(256) / 255).astype(np.float32))
_MIN_LENGTH = np.float32(1e-3)  # of a normal with a defined direction


def decode(
    texels: Shaped[NDArray[Any], "*batch channels"], encoding: TextureEncoding | None
) -> Shaped[F32, "*batch channels"]:
    """Decode texels.

    Args:
        texels: bytes, or float values if there is no encoding; one channel for kind "share", otherwise three.
    Returns:
        Linear RGB, unit normals, or values of one channel.
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
    """Yield the decoded rows of a texture in batches. (rows, width, 3 or 1) each"""
    for start in range(0, len(texture.pixels), ROWS_PER_BATCH):
        yield decode(texture.pixels[start : start + ROWS_PER_BATCH], texture.encoding)


def mean_value(texture: Texture) -> Shaped[F64, " channels"]:
    """Mean of the decoded texture."""
    total = sum(rows.sum(axis=(0, 1), dtype=np.float64) for rows in decode_rows(texture))
    return np.asarray(total / (texture.pixels.shape[0] * texture.pixels.shape[1]))


def encode_rows(
    values: Callable[[slice], F32], size: tuple[int, int], max_value: Shaped[F64, " 3"], wrap: tuple[str, str]
) -> Texture:
    """Encode a texture whose values are computed in batches of rows.

    Args:
        values: returns (rows, width, 3), or (1, 1, 3) for a uniform texture. size: height and width.
        max_value: upper bound of the values. wrap: wrap mode of the texture.
    """
    pixels = np.empty((*size, 3), np.uint8)
    scale = np.maximum(max_value, 1e-6)
    for start in range(0, size[0], ROWS_PER_BATCH):
        rows = slice(start, start + ROWS_PER_BATCH)
        normalized = np.asarray(values(rows) / scale, np.float32)
        pixels[rows] = np.round(np.float32(255) * srgb_encode(normalized))
    red, green, blue = scale.tolist()
    return Texture(pixels, wrap, TextureEncoding("srgb", (red, green, blue)))


def periodic(index: Shaped[NDArray[np.float64], " n"], size: int, wrap: str) -> Shaped[NDArray[np.int64], " n"]:
    """Wrap texel indices into the image. Reduction in float64 keeps distant indices exact.

    Args:
        index: whole numbers. size: texels along the axis. wrap: see `relume.scene.model.Texture`.
    """
    if wrap == "clamp":
        return np.clip(index, 0, size - 1).astype(np.int64)
    if wrap == "mirror":
        folded = np.mod(index, 2 * size)
        return np.asarray(np.minimum(folded, 2 * size - 1 - folded), np.int64)
    return np.asarray(np.mod(index, size), np.int64)
