"""Reads pixels of .hdr and .exr files, which may be hostile, in linear Rec. 709."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813  (the name its own documentation gives it)
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.image_io.primaries import convert, to_rec_709

F32 = NDArray[np.float32]

MAX_EXPANSION = 1_000  # deflate packs zeros 1,032 : 1; no photograph comes near it
FREE_BYTES = 64 << 20  # may be claimed by any file, however small
EXR_MAGIC = b"\x76\x2f\x31\x01"
oiio.attribute("try_all_readers", 0)  # else what the reader of a suffix refuses goes to twenty others
CheckSize = Callable[[int, int], None]
ChooseRows = Callable[[int, int], int]


def check_claim(claimed_bytes: int, data: bytes, label: str) -> None:
    """Hold what a header claims to what the file could unpack to: a few bytes may claim gigabytes.

    claimed_bytes: of pixels. data: of the file. label: of the file in messages. Raises SceneError.
    """
    if claimed_bytes > max(FREE_BYTES, MAX_EXPANSION * len(data)):
        raise SceneError(
            f"{label} claims {claimed_bytes / 1e6:,.0f} MB of pixels and holds {len(data) / 1e6:,.1f} MB; "
            "it is truncated or damaged, export it again"
        )


def _check_tiles(spec: oiio.ImageSpec, data: bytes, label: str) -> None:
    """Hold tiles to what can be in the file: each has 8 bytes in its table, and the decoder holds a whole one."""
    if spec.tile_width == 0:
        return
    num_tiles = -(-spec.width // spec.tile_width) * -(-spec.height // spec.tile_height)
    if 8 * num_tiles > len(data):
        raise SceneError(f"{label} has more tiles than data; it is damaged, export it again")
    check_claim(spec.tile_width * spec.tile_height * spec.nchannels * 4, data, label)


def read_pixels(data: bytes, suffix: str, label: str, check_size: CheckSize) -> F32:
    """Let OpenImageIO decode from a private temporary file, header first, pixels only when the size is allowed.

    Args:
        data: of the file. suffix: that its first bytes tell. label: it is, in messages.
        check_size: raises SceneError where width and height are not taken.
    Returns:
        The first R, G and B, or one channel for all. (height, width, 3) float32
    Raises:
        SceneError: damaged, too large, or of no plain image.
    """

    def all_rows(width: int, height: int) -> int:
        check_size(width, height)
        return height

    (pixels,) = read_strips(data, suffix, label, all_rows)
    return pixels


def read_strips(data: bytes, suffix: str, label: str, choose_rows: ChooseRows) -> Iterator[F32]:
    """The same a few rows at a time, from the top.

    Args:
        data, suffix, label: as of `read_pixels`.
        choose_rows: of an image of some width and height, how many rows are wanted at once, at most all of them; raises
            SceneError where it is not taken. Those of an image of tiles come all at once.
    """
    handle, path = tempfile.mkstemp(suffix=suffix)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        image = oiio.ImageInput.open(path)
        if image is None:
            _clear_error(oiio.geterror)
            raise SceneError(f"{label} is damaged or not what its first bytes say; export it again")
        try:
            yield from _read_open_image(image, data, label, choose_rows)
        except UnicodeDecodeError:  # names in the header that are no text
            raise SceneError(f"{label} is damaged; export it again") from None
        finally:
            image.close()
    finally:
        Path(path).unlink()


def _read_open_image(image: oiio.ImageInput, data: bytes, label: str, choose_rows: ChooseRows) -> Iterator[F32]:
    spec = image.spec()
    rows = choose_rows(spec.width, spec.height)
    if spec.depth != 1 or spec.deep or not 1 <= spec.nchannels <= 16:
        raise SceneError(f"{label} is deep or has {spec.nchannels} channels; save it as plain RGB")
    matrix = _conversion_matrix(spec, label)
    names = [channel.rpartition(".")[2].upper() for channel in spec.channelnames]
    order = [names.index(c) for c in "RGB"] if {"R", "G", "B"} <= set(names) else [0, 0, 0]
    first, last = min(order), max(order)
    if last - first > 3 and spec.width * spec.height > 1 << 24:
        raise SceneError(f"{label} has channels between its RGB; save it as plain RGB")
    _check_tiles(spec, data, label)
    check_claim(spec.width * spec.height * (last + 1 - first) * 4, data, label)
    for start in range(0, spec.height, spec.height if spec.tile_width else rows):
        if spec.tile_width:
            pixels = image.read_image(0, 0, first, last + 1, oiio.FLOAT)
        else:
            stop = min(start + rows, spec.height)
            pixels = image.read_scanlines(0, 0, spec.y + start, spec.y + stop, 0, first, last + 1, oiio.FLOAT)
        if pixels is None:
            _clear_error(image.geterror)
            raise SceneError(f"{label} ends early or is damaged; export it again")
        rgb = np.asarray(pixels, np.float32)
        rgb = rgb if order == [first, first + 1, first + 2] else rgb[..., [c - first for c in order]]
        if matrix is not None and last > first:  # grey has no primaries
            convert(rgb, matrix)
        yield rgb


def _conversion_matrix(spec: oiio.ImageSpec, label: str) -> NDArray[np.float64] | None:
    """What converts the file's colours to ours; None where they are."""
    chromaticities = spec.getattribute("chromaticities")
    if chromaticities is None:
        return None
    try:
        return to_rec_709(chromaticities)
    except (TypeError, ValueError) as problem:
        raise SceneError(f"{label} has odd primaries ({problem}); export it as linear Rec. 709") from None


def _clear_error(take_error: Callable[[], str]) -> None:
    """Take the message that OpenImageIO keeps until it is asked for; it may quote bytes that are no text."""
    with suppress(UnicodeDecodeError):
        take_error()
