"""Pixels of frames: shared-exponent and float tiles, displayed images."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from relume_client.bodies import FrameHeader
from relume_client.errors import ServerVersionError

DISPLAYED = frozenset({"png", "jpeg"})
_MAX_HEADER_BYTES = 1 << 20
_PIXEL_BYTES = {"rgb9e5": 4, "f32": 12}
_SHIFTS = np.array([0, 9, 18], np.uint32)


@dataclass(frozen=True)
class Frame:
    """A frame as it was sent: header, and the payload of its tiles."""

    header: FrameHeader
    payload: bytes


def parse_frame(message: bytes) -> Frame:
    """Split a binary message. Raises ServerVersionError if it is not a frame."""
    try:
        (length,) = struct.unpack_from("<I", message)
        if length > _MAX_HEADER_BYTES:
            raise ValueError("its header is too long")
        header = cast(FrameHeader, json.loads(message[4 : 4 + length]))
        frame = Frame(header, message[4 + length :])
        _check(frame)
    except (struct.error, ValueError, KeyError, TypeError) as error:
        raise ServerVersionError(f"the server sent a frame that cannot be read: {error}") from None
    return frame


def _check(frame: Frame) -> None:
    """Raise ValueError if tiles are outside of the image, or their bytes are not those of the payload."""
    header = frame.header
    for x, y, width, height in header["tiles"]:
        if min(x, y) < 0 or min(width, height) < 1 or x + width > header["width"] or y + height > header["height"]:
            raise ValueError("it has a tile outside of the image")
    if header["format"] in _PIXEL_BYTES:
        pixels = sum(width * height for _, _, width, height in header["tiles"])
        if len(frame.payload) != pixels * (_PIXEL_BYTES[header["format"]] + header.get("alpha", False)):
            raise ValueError("its tiles do not match its bytes")


def decode_rgb9e5(words: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Decode EXT_texture_shared_exponent: color = mantissa · 2^(exponent − 24).

    Args:
        words: (n,) uint32
    Returns:
        Linear radiance. (n, 3) float32
    """
    mantissas = ((words[:, None] >> _SHIFTS) & np.uint32(0x1FF)).astype(np.float32)
    return np.ldexp(mantissas, (words >> np.uint32(27)).astype(np.int32)[:, None] - 24)


def add_tiles(image: NDArray[np.float32] | None, frame: Frame) -> NDArray[np.float32]:
    """The image with the tiles of a frame, in place; a new one if the size has changed.

    Args:
        image: linear radiance, black where nothing was received. (height, width, 3)
        frame: of the format rgb9e5 or f32.
    """
    header = frame.header
    shape = header["height"], header["width"], 3
    if image is None or image.shape != shape:
        image = np.zeros(shape, np.float32)
    pixels, start = _linear_pixels(frame), 0
    for x, y, width, height in header["tiles"]:
        image[y : y + height, x : x + width] = pixels[start : start + width * height].reshape(height, width, 3)
        start += width * height
    return image


def _linear_pixels(frame: Frame) -> NDArray[np.float32]:
    """Pixels of all tiles; the coverage after them is left out."""
    tiles: Sequence[Sequence[int]] = frame.header["tiles"]
    count = sum(width * height for _, _, width, height in tiles)
    if frame.header["format"] == "f32":
        return np.frombuffer(frame.payload, "<f4", 3 * count).reshape(count, 3)
    return decode_rgb9e5(np.frombuffer(frame.payload, "<u4", count))


def decode_displayed(payload: bytes) -> NDArray[np.uint8]:
    """Decode a PNG, WebP or JPEG image. (height, width, 3) uint8"""
    from PIL import Image  # not before: programs that decode no image, such as the Blender add-on, have no Pillow

    with Image.open(io.BytesIO(payload)) as image:
        return np.array(image.convert("RGB"))
