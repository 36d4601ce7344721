"""Reader for .hdr and .exr files from untrusted sources, in linear Rec. 709."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import OpenImageIO as oiio  # noqa: N813  (the name its own documentation gives it)
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored, quote, unsupported
from relume.image_io.color_channels import ColorChannels, find_color_channels
from relume.image_io.open_image import check_claim, clear_error, open_image
from relume.image_io.primaries import INTEROP_SPACES, convert, declared_primaries

F32 = NDArray[np.float32]

EXR_MAGIC = b"\x76\x2f\x31\x01"
CheckSize = Callable[[int, int], None]
ChooseRows = Callable[[int, int], int]
_NO_SPACE = ("", "unknown", "data")
_MAX_HALF, _MAX_FLOAT = 65_504.0, 1e30  # conversion of primaries keeps the latter finite


def read_pixels(
    data: bytes, suffix: str, label: str, check_size: CheckSize
) -> tuple[Shaped[F32, "height width 3"], list[ImporterWarning]]:
    """Decode an image; the size is checked before pixels are read.

    Args:
        data: contents of the file. suffix: format, determined from the first bytes. label: name in messages.
        check_size: raises SceneError if width and height are not allowed.
    Returns:
        As `LinearReader.strips` and `LinearReader.warnings`.
    Raises:
        SceneError: the file is damaged, too large, or shows no colors.
    """

    def all_rows(width: int, height: int) -> int:
        check_size(width, height)
        return height

    reader = LinearReader(data, suffix, label)
    (pixels,) = reader.strips(all_rows)
    return pixels, reader.warnings


class LinearReader:
    """Decodes an image, a few rows at a time.

    Attributes:
        warnings: predicates, to which the caller adds a subject; complete after the last strip.
        is_openexr_cube: the header says that the image has the faces of a cube; set with the first strip.
    """

    def __init__(self, data: bytes, suffix: str, label: str) -> None:
        self._data, self._suffix, self._label = data, suffix, label
        self._num_rows = self._num_missing = self._num_infinite = 0
        self.warnings: list[ImporterWarning] = []
        self.is_openexr_cube = False

    def strips(self, choose_rows: ChooseRows) -> Iterator[Shaped[F32, "rows width 3"]]:
        """Decode the display window from the top, with zeros where the file has no pixels.

        Args:
            choose_rows: returns the number of rows per strip for a width and height, at most all; raises SceneError if
                the size is not allowed.
        Yields:
            R, G and B, or the luminance for all, in linear Rec. 709; infinite values become the largest finite ones,
            NaN stays.
        Raises:
            SceneError: the file is damaged, too large, or shows no colors.
        """
        with open_image(self._data, self._suffix, self._label) as image:
            channels = find_color_channels(image, self._label)
            spec, matrix = channels.spec, None
            rows = choose_rows(spec.full_width, spec.full_height)
            _check_claims(channels, self._data, self._label)
            self.warnings += _layer_warnings(channels)
            self.is_openexr_cube = spec.get_string_attribute("textureformat") == "CubeFace Environment"
            if len(channels.indices) == 3:  # gray has no primaries
                matrix, warnings = _primaries(spec)
                self.warnings += warnings
            limit = _MAX_HALF if str(spec.channelformat(channels.indices[0])) == "half" else _MAX_FLOAT
            blocks = _BlockReader(image, channels, is_sequential=self._suffix == ".hdr")
            for start in range(0, spec.full_height, rows):
                strip = self._strip(blocks, spec, start, min(start + rows, spec.full_height))
                self._num_infinite += int(np.isinf(strip).any(axis=-1).sum())
                np.clip(strip, -limit, limit, out=strip)
                if matrix is not None:
                    convert(strip, matrix)
                yield strip
        if self._num_missing == self._num_rows > 0:
            raise SceneError(f"{self._label} ends early or is damaged; export it again")
        self.warnings += self._repair_warnings(spec)

    def _strip(self, blocks: _BlockReader, spec: oiio.ImageSpec, start: int, stop: int) -> F32:
        """Rows of the display window. start, stop: from its top"""
        strip = np.zeros((stop - start, spec.full_width, 3), np.float32)
        left, right = max(spec.x, spec.full_x), min(spec.x + spec.width, spec.full_x + spec.full_width)
        y, last = max(spec.y, spec.full_y + start), min(spec.y + spec.height, spec.full_y + stop)
        while y < last and left < right:
            block = blocks.read(y)
            end = min(last, block.stop)
            self._num_rows += end - y
            if block.pixels is None:
                self._num_missing += end - y
            else:
                rows = slice(y - spec.full_y - start, end - spec.full_y - start)
                pixels = block.pixels[y - block.start : end - block.start, left - spec.x : right - spec.x]
                strip[rows, left - spec.full_x : right - spec.full_x] = pixels
            y = end
        return strip

    def _repair_warnings(self, spec: oiio.ImageSpec) -> Iterator[ImporterWarning]:
        if self._num_missing:
            count = f"{self._num_missing:,} of its {spec.full_height:,} rows"
            yield unsupported(f"ends early or is damaged: {count} were made black.")
        if self._num_infinite:
            yield approximated(f"has {self._num_infinite:,} infinite texels, read as the largest number.")
        if (spec.x, spec.y, spec.width, spec.height) != (spec.full_x, spec.full_y, spec.full_width, spec.full_height):
            data, display = f"{spec.width}×{spec.height}", f"{spec.full_width}×{spec.full_height}"
            yield approximated(
                f"has a data window of {data} in a display window of {display}: pixels outside the display window were "
                "cut off, and missing ones are black."
            )


class _PixelRows(NamedTuple):
    """Rows `start` to `stop` of the data window. pixels: (rows, width, 1 or 3); None if damaged"""

    start: int
    stop: int
    pixels: F32 | None


class _BlockReader:
    """Reads whole chunks of scan lines, or rows of tiles, and stores the last one.

    Args:
        is_sequential: nothing can be read behind damaged data.
    """

    def __init__(self, image: oiio.ImageInput, channels: ColorChannels, is_sequential: bool) -> None:
        self._image, self._channels, self._is_sequential = image, channels, is_sequential
        self._block = _PixelRows(0, 0, np.empty(0, np.float32))

    def read(self, y: int) -> _PixelRows:
        """Return the block that has row y."""
        if not self._block.start <= y < self._block.stop:
            spec, was_damaged = self._channels.spec, self._block.pixels is None
            height = _block_rows(spec)
            start = y - (y - spec.y) % height
            stop = min(start + height, spec.y + spec.height)
            pixels = None if was_damaged and self._is_sequential else self._pixels(start, stop)
            self._block = _PixelRows(start, stop, pixels)
        return self._block

    def _pixels(self, start: int, stop: int) -> F32 | None:
        indices = self._channels.indices
        if indices == tuple(range(indices[0], indices[-1] + 1)):
            return self._read_channels(start, stop, indices[0], indices[-1] + 1)
        planes = []
        for index in indices:  # one by one: there may be many between them
            plane = self._read_channels(start, stop, index, index + 1)
            if plane is None:
                return None
            planes.append(plane)
        return np.concatenate(planes, axis=-1)

    def _read_channels(self, start: int, stop: int, first: int, last: int) -> F32 | None:
        part, spec = self._channels.part, self._channels.spec
        if spec.tile_width:
            columns = spec.x, spec.x + spec.width
            pixels = self._image.read_tiles(part, 0, *columns, start, stop, 0, 1, first, last, oiio.FLOAT)
        else:
            pixels = self._image.read_scanlines(part, 0, start, stop, 0, first, last, oiio.FLOAT)
        if pixels is None:
            clear_error(self._image.geterror)
            return None
        return np.asarray(pixels, np.float32).reshape(stop - start, spec.width, last - first)


def _block_rows(spec: oiio.ImageSpec) -> int:
    return int(spec.tile_height if spec.tile_width else spec.get_int_attribute("oiio:RowsPerChunk", 1))


def _check_claims(channels: ColorChannels, data: bytes, label: str) -> None:
    """Reject pixels and blocks that the file cannot contain: the decoder allocates blocks with all channels."""
    spec = channels.spec
    for width, height in ((spec.width, spec.height), (spec.full_width, spec.full_height)):
        if min(width, height) < 1:
            raise SceneError(f"{label} has no pixels; export it again")
        check_claim(width * height * 4 * len(channels.indices), data, label)
    if spec.tile_width:
        num_tiles = -(-spec.width // spec.tile_width) * -(-spec.height // spec.tile_height)
        if 8 * num_tiles > len(data):  # each has 8 bytes in a table
            raise SceneError(f"{label} has more tiles than data; it is damaged, export it again")
    check_claim(_block_rows(spec) * (spec.tile_width or spec.width) * spec.nchannels * 4, data, label)


def _primaries(spec: oiio.ImageSpec) -> tuple[Shaped[NDArray[np.float64], "3 3"] | None, list[ImporterWarning]]:
    """The declared primaries of a file, by numbers or by the name of a color space; see `declared_primaries`."""
    chromaticities, space = spec.getattribute("chromaticities"), spec.get_string_attribute("colorInteropID")
    if chromaticities is None and space not in _NO_SPACE:
        if space not in INTEROP_SPACES:
            return None, [unsupported(f"has the color space {quote(space)}; it was read as linear Rec. 709.")]
        chromaticities = INTEROP_SPACES[space]
    return (None, []) if chromaticities is None else declared_primaries(chromaticities)


def _layer_warnings(channels: ColorChannels) -> Iterator[ImporterWarning]:
    if channels.num_layers > 1:
        layer = quote(channels.layer) if channels.layer else "the main one"
        yield ignored(f"has {channels.num_layers} layers with colors, of which {layer} was read.")
