"""Reader for .hdr and .exr files from untrusted sources, in linear Rec. 709."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813  (the name its own documentation gives it)
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.image_io.primaries import convert, to_rec_709

F32 = NDArray[np.float32]

MAX_EXPANSION = 1_000  # deflate compresses zeros 1,032 : 1; photographs do not come near it
FREE_BYTES = 64 << 20  # any file may claim these, however small
EXR_MAGIC = b"\x76\x2f\x31\x01"
oiio.attribute("try_all_readers", 0)  # otherwise a file rejected by its suffix's reader goes to twenty others
CheckSize = Callable[[int, int], None]
ChooseRows = Callable[[int, int], int]


def check_claim(claimed_bytes: int, data: bytes, label: str) -> None:
    """Reject headers that claim more pixels than the file could contain: a few bytes may claim gigabytes.

    Args:
        claimed_bytes: size of the pixels. data: contents of the file. label: name of the file in messages.
    Raises:
        SceneError: the header claims too much.
    """
    if claimed_bytes > max(FREE_BYTES, MAX_EXPANSION * len(data)):
        raise SceneError(
            f"{label} claims {claimed_bytes / 1e6:,.0f} MB of pixels and holds {len(data) / 1e6:,.1f} MB; "
            "it is truncated or damaged, export it again"
        )


def _check_tiles(spec: oiio.ImageSpec, data: bytes, label: str) -> None:
    """Reject tiles that the file cannot contain: each has 8 bytes in a table, and the decoder allocates a whole one."""
    if spec.tile_width == 0:
        return
    num_tiles = -(-spec.width // spec.tile_width) * -(-spec.height // spec.tile_height)
    if 8 * num_tiles > len(data):
        raise SceneError(f"{label} has more tiles than data; it is damaged, export it again")
    check_claim(spec.tile_width * spec.tile_height * spec.nchannels * 4, data, label)


def read_pixels(data: bytes, suffix: str, label: str, check_size: CheckSize) -> Shaped[F32, "height width 3"]:
    """Decode an image with OpenImageIO from a private temporary file; the size is checked before pixels are read.

    Args:
        data: contents of the file. suffix: format, determined from the first bytes. label: name in messages.
        check_size: raises SceneError if width and height are not allowed.
    Returns:
        The first R, G and B, or one channel for all
    Raises:
        SceneError: the file is damaged, too large, or not a plain image.
    """

    def all_rows(width: int, height: int) -> int:
        check_size(width, height)
        return height

    (pixels,) = read_strips(data, suffix, label, all_rows)
    return pixels


def read_strips(data: bytes, suffix: str, label: str, choose_rows: ChooseRows) -> Iterator[F32]:
    """Decode an image like `read_pixels`, a few rows at a time, from the top.

    Args:
        data, suffix, label: as in `read_pixels`.
        choose_rows: returns the number of rows per strip for a width and height, at most all; raises SceneError if the
            size is not allowed. Tiled images have a single strip.
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
        except UnicodeDecodeError:  # names in the header that are not valid text
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
        if matrix is not None and last > first:  # gray has no primaries
            convert(rgb, matrix)
        yield rgb


def _conversion_matrix(spec: oiio.ImageSpec, label: str) -> NDArray[np.float64] | None:
    """Matrix that converts the file's colors to linear Rec. 709; None if none is needed."""
    chromaticities = spec.getattribute("chromaticities")
    if chromaticities is None:
        return None
    try:
        return to_rec_709(chromaticities)
    except (TypeError, ValueError) as problem:
        raise SceneError(f"{label} has invalid primaries ({problem}); export it as linear Rec. 709") from None


def _clear_error(take_error: Callable[[], str]) -> None:
    """Discard OpenImageIO's stored error message, which may contain invalid text."""
    with suppress(UnicodeDecodeError):
        take_error()
