"""The container of the Bonn measurements of 2014, ".btf": a BTF as products of two matrices for each color channel.

    "!DFMF08FCR"                                 everything else is little-endian, without padding
    u32 bytes of this section, u32 version       three texts of 80 bytes, 4 f32 (pixels per mm, scale of RGB);
                                                 version > 1: u32, nonzero if values include the light's cosine;
                                                 > 2: u32 bytes, XML; > 3: u32 channels, for each u32 bytes, its name
    u32 views, for each 2 f32 θ φ                and u32 lights, for each 2 f32 θ φ; the same lights for each view
    u32 width, u32 height                        u32 rotations, for each 9 f32
    u32 components, i32 color model              3 f32 mean, 9 f32 matrix, used by some models
    for each channel: u8 bytes of a number       u32 components C, u32 rows N, u32 columns M, C singular values,
                                                 N × C, M × C, including the singular values

N are pairs of directions, all lights for each view, and M texels, row by row, or vice versa. This agrees with Bonn's
btflib and with the reader in PyPI's btf-extractor.

All sizes are checked against the file's before they are used; matrices are memory-mapped.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.compress import MAX_TEXELS
from relume.assets.btf.direction_rings import MAX_DIRECTIONS
from relume.core.errors import MaterialError

F64 = NDArray[np.float64]
Matrix = NDArray[Any]

FIRST_BYTE = b"!"
"""Of all containers of the Bonn measurements, unlike zip files."""
_SIGNATURE = b"!DFMF08FCR"
_TEXTS = 3 * 80
_MAX_COMPONENTS = 1024
_FLOATS = {2: "<f2", 4: "<f4", 8: "<f8"}
_CHANNELS = 3


class Channel(NamedTuple):
    """Factors of one color channel; their product has a value for each pair of directions and texel. Memory-mapped."""

    pairs: Shaped[Matrix, "pairs components"]
    texels: Shaped[Matrix, "texels components"]


class BonnContainer(NamedTuple):
    """The content of a file.

    Attributes:
        has_cosine: values include the light's cosine.
        views, lights: θ and φ, radians.
        size: height and width, texels. model: color model of the file. channels: three.
    """

    has_cosine: bool
    views: Shaped[F64, "views 2"]
    lights: Shaped[F64, "lights 2"]
    size: tuple[int, int]
    model: int
    channels: tuple[Channel, ...]


class _Reader:
    """Reads a file sequentially."""

    def __init__(self, path: Path) -> None:
        self._bytes = np.memmap(path, np.uint8, "r") if path.stat().st_size else np.zeros(0, np.uint8)
        self._offset = 0

    @property
    def remaining_bytes(self) -> int:
        """Number of unread bytes."""
        return len(self._bytes) - self._offset

    @property
    def offset(self) -> int:
        """Number of bytes that were read."""
        return self._offset

    def skip(self, count: int) -> NDArray[np.uint8]:
        """Read bytes, memory-mapped."""
        if count > self.remaining_bytes:
            raise damaged_error(f"{count:,} bytes should follow, {self.remaining_bytes:,} do")
        self._offset += count
        return self._bytes[self._offset - count : self._offset]

    def read_numbers(self, kind: str, *shape: int) -> Matrix:
        """Read an array, memory-mapped."""
        dtype, count = np.dtype(kind), 1
        for extent in shape:
            count *= extent
        data = self.skip(count * dtype.itemsize)
        return np.ndarray(shape, dtype, data)

    def read_count(self, label: str, maximum: int, minimum: int = 1) -> int:
        """Read a count, and check its limits."""
        value = int(self.read_numbers("<u4", 1)[0])
        if not minimum <= value <= maximum:
            raise MaterialError(
                f"the .btf file claims to have {value:,} {label}, outside the limits of {minimum:,} to {maximum:,}; "
                "choose a smaller version of it, or download it again"
            )
        return value


def damaged_error(detail: str) -> MaterialError:
    """Return the error for a damaged file."""
    return MaterialError(f"the .btf file is truncated or damaged: {detail}; download it again")


def read_container(path: Path) -> BonnContainer:
    """Read the header of a file, and memory-map its matrices.

    Args:
        path: path of the file.
    Raises:
        MaterialError: it is another kind of container, damaged, or too large.
    """
    file = _Reader(path)
    _check_kind(file)
    has_cosine = _read_description(file)
    views, lights = _directions(file)
    width, height = (file.read_count(label, MAX_TEXELS) for label in ("texels per row", "rows of texels"))
    if width * height > MAX_TEXELS:
        raise MaterialError(
            f"the BTF has {width}×{height} texels, the limit is {MAX_TEXELS:,}; choose a smaller version of it"
        )
    file.read_numbers("<f4", file.read_count("rotations", MAX_TEXELS, 0), 9)
    file.read_count("components", _MAX_COMPONENTS)
    model = int(file.read_numbers("<i4", 1)[0])
    file.read_numbers("<f4", 12)
    pairs = len(views) * len(lights)
    channels = tuple(_channel(file, pairs, width * height) for _ in range(_CHANNELS))
    if file.remaining_bytes:
        raise damaged_error(f"{file.remaining_bytes:,} bytes follow its end")
    return BonnContainer(has_cosine, views, lights, (height, width), model, channels)


def _check_kind(file: _Reader) -> None:
    """Read and check the signature."""
    kind = bytes(file.skip(min(len(_SIGNATURE), file.remaining_bytes)))
    if kind != _SIGNATURE:
        raise MaterialError(
            "the .btf file is not a decorrelated full matrix factorization (DFMF), as those of UBO2014 are, but "
            f"{kind.decode('ascii', 'replace')!r}; write its images to a zip, named by their directions such as "
            "'tl030 pl060 tv045 pv270.png', and import that"
        )


def _read_description(file: _Reader) -> bool:
    """Skip the description; return True if values include the light's cosine."""
    start = file.offset
    size, version = (int(number) for number in file.read_numbers("<u4", 2))
    file.skip(_TEXTS)
    file.read_numbers("<f4", 4)
    has_cosine = version > 1 and file.read_count("cosine flags", 2**32 - 1, 0) != 0
    if version > 2:
        file.skip(file.read_count("bytes of XML", file.remaining_bytes, 0))
    if version > 3:
        file.read_count("color channels", _CHANNELS, _CHANNELS)
        for _ in range(_CHANNELS):
            file.skip(file.read_count("bytes of a channel's name", file.remaining_bytes, 0))
    if file.offset - start != size:
        raise damaged_error(f"its description has {file.offset - start:,} bytes, not {size:,}")
    return has_cosine


def _directions(file: _Reader) -> tuple[F64, F64]:
    """Read view and light directions: θ and φ."""
    views: list[Matrix] = []
    lights: Matrix | None = None
    for _ in range(file.read_count("view directions", MAX_DIRECTIONS)):
        views.append(file.read_numbers("<f4", 2))
        view_lights = file.read_numbers("<f4", file.read_count("light directions", MAX_DIRECTIONS), 2)
        if lights is not None and not np.array_equal(lights, view_lights, equal_nan=True):
            raise MaterialError("the views of the BTF have different light directions; resample it")
        lights = view_lights
    return np.array(views, np.float64), np.array(lights, np.float64)


def _channel(file: _Reader, pairs: int, texels: int) -> Channel:
    kind = _FLOATS.get(int(file.read_numbers("u1", 1)[0]))
    if kind is None:
        raise damaged_error("its numbers do not have two, four or eight bytes")
    components = file.read_count("components", _MAX_COMPONENTS)
    rows, columns = (int(number) for number in file.read_numbers("<u4", 2))
    if (rows, columns) not in ((pairs, texels), (texels, pairs)):
        raise damaged_error(f"{rows:,} × {columns:,} values, not {pairs:,} pairs of directions × {texels:,} texels")
    file.read_numbers(kind, components)  # singular values, which the second matrix contains
    left, right = file.read_numbers(kind, rows, components), file.read_numbers(kind, columns, components)
    return Channel(left, right) if rows == pairs else Channel(right, left)
