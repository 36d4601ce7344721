"""Frames of sessions as arrays, and frames that are not what they say."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
import pytest
from rgb9e5 import rgb9e5_pack, rgb9e5_unpack

from relume_client.errors import ServerVersionError
from relume_client.images import add_tiles, decode_rgb9e5, parse_frame

HEADER: dict[str, Any] = {"width": 4, "height": 2, "tiles": [[1, 0, 2, 1], [0, 1, 1, 1]], "format": "rgb9e5"}


def message(payload: bytes, **fields: Any) -> bytes:
    head = json.dumps({**HEADER, **fields}).encode()
    return struct.pack("<I", len(head)) + head + payload


def test_shared_exponents() -> None:
    rgb = np.random.default_rng(1).lognormal(0, 4, (500, 3)).astype(np.float32).clip(0, 60000)
    words = rgb9e5_pack(rgb).astype("<u4")
    assert np.array_equal(decode_rgb9e5(words), rgb9e5_unpack(words))
    assert np.all(np.abs(decode_rgb9e5(words) - rgb) <= rgb.max(axis=1, keepdims=True) / 512 + 2**-24)
    assert decode_rgb9e5(np.array([256 | 511 << 9 | (24 << 27)], np.uint32)).tolist() == [[256, 511, 0]]


@pytest.mark.parametrize("alpha", [b"", b"\xff\x80\x00"])
def test_tiles_are_added_to_the_image(alpha: bytes) -> None:
    values = np.arange(9, dtype="<f4")
    frame = parse_frame(message(values.tobytes() + alpha, format="f32", alpha=bool(alpha)))
    image = add_tiles(None, frame)
    expected = np.zeros((2, 4, 3))
    expected[0, 1], expected[0, 2], expected[1, 0] = values.reshape(3, 3)
    assert np.array_equal(image, expected)
    words = np.full(1, 1 | 24 << 27, "<u4")
    again = add_tiles(image, parse_frame(message(words.tobytes(), tiles=[[3, 1, 1, 1]])))
    expected[1, 3] = 1, 0, 0
    assert again is image
    assert np.array_equal(again, expected)
    assert add_tiles(image, parse_frame(message(b"", width=2, height=2, tiles=[]))).shape == (2, 2, 3)


@pytest.mark.parametrize(
    ("sent", "reason"),
    [
        (b"", "unpack"),
        (struct.pack("<I", 2**31), "header is too long"),
        (struct.pack("<I", 3) + b"{]}", "Expecting"),
        (struct.pack("<I", 2) + b"[]", "indices"),
        (struct.pack("<I", 2) + b"{}", "tiles"),
        (message(b"\0" * 12, tiles=[[3, 0, 2, 1]]), "outside of the image"),
        (message(b"\0" * 12, tiles=[[0, -1, 1, 1]]), "outside of the image"),
        (message(b"\0" * 11), "do not match"),
        (message(b"\0" * 16), "do not match"),
    ],
)
def test_frames_that_are_not_what_they_say(sent: bytes, reason: str) -> None:
    with pytest.raises(ServerVersionError, match=f"cannot be read: .*{reason}"):
        parse_frame(sent)
