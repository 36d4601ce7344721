"""The container of the Bonn measurements of 2014, ".btf": a BTF as products of two matrices for each colour channel.

    "!DFMF08FCR"                                 then everything little-endian, without gaps
    u32 bytes of this part, u32 version          three texts of 80 bytes, 4 f32 (pixels per mm, scale of RGB);
                                                 version > 1: u32, whether the light's cosine is in the values;
                                                 > 2: u32 bytes, XML; > 3: u32 channels, of each u32 bytes, its name
    u32 views, of each 2 f32 θ φ                 and u32 lights, of each 2 f32 θ φ; the same lights for each view
    u32 width, u32 height                        u32 rotations, of each 9 f32
    u32 components, i32 colour model             3 f32 mean, 9 f32 matrix, of models that have one
    of each channel: u8 bytes of a number        u32 components C, u32 rows N, u32 columns M, C singular values,
                                                 N × C, M × C that these are in

N are pairs of directions, light after light for each view, and M texels, row after row, or the other way about. This is
what Bonn's own btflib and the reader that PyPI's btf-extractor is made of agree on.

All sizes are held against the file's before anything is read by them; matrices stay on the disk.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.btf.compress import MOST_TEXELS
from relume.btf.rings import MOST_DIRECTIONS
from relume.errors import MaterialError

F64 = NDArray[np.float64]
Matrix = NDArray[Any]

FIRST_BYTE = b"!"
"""Of all containers of the Bonn measurements; a zip has another."""
_SIGNATURE = b"!DFMF08FCR"
_TEXTS = 3 * 80
_MOST_COMPONENTS = 1024
_FLOATS = {2: "<f2", 4: "<f4", 8: "<f8"}
_CHANNELS = 3


class Channel(NamedTuple):
    """Values of pairs of directions and of texels: their product. (V · L, C), (texels, C), on the disk"""

    pairs: Matrix
    texels: Matrix


class Container(NamedTuple):
    """What a file holds.

    Attributes:
        has_cosine: whether the light's cosine is in its values.
        views, lights: θ and φ, radians. (V, 2), (L, 2)
        size: height and width, texels. model: of its colours. channels: three.
    """

    has_cosine: bool
    views: F64
    lights: F64
    size: tuple[int, int]
    model: int
    channels: tuple[Channel, ...]


class _Reader:
    """Parts of a file, one after another.

    Args:
        path: of the file.
    """

    def __init__(self, path: Path) -> None:
        self._bytes = np.memmap(path, np.uint8, "r") if path.stat().st_size else np.zeros(0, np.uint8)
        self._at = 0

    @property
    def left(self) -> int:
        """Bytes."""
        return len(self._bytes) - self._at

    @property
    def at(self) -> int:
        """Bytes before what comes next."""
        return self._at

    def skip(self, count: int) -> NDArray[np.uint8]:
        """The next bytes, on the disk."""
        if count > self.left:
            raise damaged(f"{count:,} bytes are to follow, {self.left:,} do")
        self._at += count
        return self._bytes[self._at - count : self._at]

    def numbers(self, kind: str, *shape: int) -> Matrix:
        """The next numbers, on the disk."""
        dtype, count = np.dtype(kind), 1
        for extent in shape:
            count *= extent
        found = self.skip(count * dtype.itemsize)
        return np.ndarray(shape, dtype, found)

    def count(self, what: str, most: int, least: int = 1) -> int:
        """The next number of things, bounded."""
        found = int(self.numbers("<u4", 1)[0])
        if not least <= found <= most:
            raise MaterialError(
                f"the .btf file says that it has {found:,} {what}; {least:,} to {most:,} can be read: choose a smaller "
                "version of it, or download it again"
            )
        return found


def damaged(what: str) -> MaterialError:
    """What is wrong with a file that is not whole."""
    return MaterialError(f"the .btf file is cut off or damaged: {what}; download it again")


def read_container(path: Path) -> Container:
    """Read what a file says of itself, and find its matrices.

    Args:
        path: of the file.
    Raises:
        MaterialError: it is another kind of container, damaged, or larger than what can be kept.
    """
    file = _Reader(path)
    _check_kind(file)
    has_cosine = _described(file)
    views, lights = _directions(file)
    width, height = (file.count(what, MOST_TEXELS) for what in ("texels a row", "rows of texels"))
    if width * height > MOST_TEXELS:
        raise MaterialError(
            f"the BTF has {width}×{height} texels; at most {MOST_TEXELS:,} can be kept, choose a smaller version of it"
        )
    file.numbers("<f4", file.count("rotations", MOST_TEXELS, 0), 9)
    file.count("components", _MOST_COMPONENTS)
    model = int(file.numbers("<i4", 1)[0])
    file.numbers("<f4", 12)
    pairs = len(views) * len(lights)
    channels = tuple(_channel(file, pairs, width * height) for _ in range(_CHANNELS))
    if file.left:
        raise damaged(f"{file.left:,} bytes follow where it should end")
    return Container(has_cosine, views, lights, (height, width), model, channels)


def _check_kind(file: _Reader) -> None:
    """Pass the signature."""
    kind = bytes(file.skip(min(len(_SIGNATURE), file.left)))
    if kind != _SIGNATURE:
        raise MaterialError(
            "the .btf file is no decorrelated full matrix factorization (DFMF), as those of UBO2014 are, but "
            f"{kind.decode('ascii', 'replace')!r}; write its images into a zip, named by their directions such as "
            "'tl030 pl060 tv045 pv270.png', and import that"
        )


def _described(file: _Reader) -> bool:
    """Pass what people wrote. Whether the light's cosine is in the values."""
    begin = file.at
    size, version = (int(number) for number in file.numbers("<u4", 2))
    file.skip(_TEXTS)
    file.numbers("<f4", 4)
    has_cosine = version > 1 and file.count("marks of the cosine", 2**32 - 1, 0) != 0
    if version > 2:
        file.skip(file.count("bytes of XML", file.left, 0))
    if version > 3:
        file.count("colour channels", _CHANNELS, _CHANNELS)
        for _ in range(_CHANNELS):
            file.skip(file.count("bytes of a channel's name", file.left, 0))
    if file.at - begin != size:
        raise damaged(f"its description has {file.at - begin:,} bytes, not {size:,}")
    return has_cosine


def _directions(file: _Reader) -> tuple[F64, F64]:
    """Views and lights: θ and φ."""
    views: list[Matrix] = []
    lights: Matrix | None = None
    for _ in range(file.count("view directions", MOST_DIRECTIONS)):
        views.append(file.numbers("<f4", 2))
        found = file.numbers("<f4", file.count("light directions", MOST_DIRECTIONS), 2)
        if lights is not None and not np.array_equal(lights, found, equal_nan=True):
            raise MaterialError("light directions of the BTF differ from view to view; resample it")
        lights = found
    return np.array(views, np.float64), np.array(lights, np.float64)


def _channel(file: _Reader, pairs: int, texels: int) -> Channel:
    kind = _FLOATS.get(int(file.numbers("u1", 1)[0]))
    if kind is None:
        raise damaged("its numbers have neither two, four nor eight bytes")
    components = file.count("components", _MOST_COMPONENTS)
    rows, columns = (int(number) for number in file.numbers("<u4", 2))
    if (rows, columns) not in ((pairs, texels), (texels, pairs)):
        raise damaged(f"{rows:,} × {columns:,} values, not {pairs:,} pairs of directions × {texels:,} texels")
    file.numbers(kind, components)  # singular values, which the second matrix contains
    left, right = file.numbers(kind, rows, components), file.numbers(kind, columns, components)
    return Channel(left, right) if rows == pairs else Channel(right, left)
