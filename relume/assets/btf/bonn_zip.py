"""Zip files of images with light and view in their names: "… tl030 pl060 tv045 pv270.jpg", degrees of θ and φ (Bonn).

They are never extracted; sizes are checked before decoding.
"""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.archives.bounded import LongDirectoryError, open_bounded
from relume.assets.btf.compress import max_texels
from relume.assets.btf.direction_rings import MAX_DIRECTIONS
from relume.assets.btf.infer_directions import infer_rings, missing_direction
from relume.assets.btf.measured_image import SUFFIXES, limit_texels, read_photograph
from relume.core.errors import MaterialError

F32 = NDArray[np.float32]

_NAME = re.compile(r"tl(\d{1,3})[ _]?pl(\d{1,3})[ _]?tv(\d{1,3})[ _]?pv(\d{1,3})", re.IGNORECASE)
_MAX_ENTRIES = MAX_DIRECTIONS**2 + 1000
_MAX_DIRECTORY_BYTES = 200 * _MAX_ENTRIES
_MAX_IMAGE_BYTES = 16 << 20
_MAX_NAME_LENGTH = 100  # characters of a name
_ZIP = b"PK"
_NOT_A_BTF = (
    "the file is not a zip of images that are named by their directions, such as 'tl030 pl060 tv045 pv270.jpg', "
    "nor a .btf container"
)
_TOO_MANY = f"the zip has more than {_MAX_ENTRIES:,} files; pack only the images"
_DAMAGED = "the zip is truncated or damaged; pack it again, and upload all of it"

Direction = tuple[int, int]


class ZippedBtf:
    """The images of a zip; implements `relume.assets.btf.compressed_view.ViewArrays` without a cache.

    Args:
        path: path of the file.
    Raises:
        MaterialError: the file is not a zip of such images; or images are missing, duplicate, or of different sizes.
    """

    def __init__(self, path: Path) -> None:
        self._zip = _open_zip(path)
        self._by_pair = _index_by_directions(self._zip.infolist())
        given = sorted({direction for pair in self._by_pair for direction in pair})
        self.grid, order = infer_rings(*np.array(given, np.float64).T)
        self._order = [given[number] for number in order]
        self._check_complete()
        first = self._photograph(self._order[0], self._order[0])
        self._max_texels = max_texels(len(given))
        self._pixels, self.size = first.shape, limit_texels(first, self._max_texels).shape[:2]

    def _check_complete(self) -> None:
        pairs = ((view, light) for view in self._order for light in self._order)
        missing = [pair for pair in pairs if pair not in self._by_pair]
        if missing:
            (view, light), more = missing[0], f", the first of {len(missing):,}" if len(missing) > 1 else ""
            raise MaterialError(
                f"the image with light from {light} and view from {view} (degrees of θ and φ) is missing{more}; add it "
                "to the zip, which needs one for each pair of directions"
            )

    def get_view(self, view: int) -> Shaped[F32, "lights texels 3"]:
        """Values of all texels from one view direction."""
        view_direction = self._order[view]
        return np.stack([self._read(view_direction, light).reshape(-1, 3) for light in self._order])

    def _read(self, view: Direction, light: Direction) -> F32:
        """Read one image, linear, scaled to the allowed number of texels. (height, width, 3)"""
        image = self._photograph(view, light)
        if image.shape != self._pixels:
            sizes = (f"{shape[1]}×{shape[0]}" for shape in (image.shape, self._pixels))
            filename = _printable(self._by_pair[view, light].filename)
            raise MaterialError(
                "the image {} has {} pixels, the first one {}; scale all images to one size".format(filename, *sizes)
            )
        return limit_texels(image, self._max_texels)

    def _photograph(self, view: Direction, light: Direction) -> F32:
        entry = self._by_pair[view, light]
        try:
            data = self._zip.read(entry)
        except Exception as error:  # zipfile and zlib raise many kinds for damaged data
            raise MaterialError(
                f"the image {_printable(entry.filename)} is damaged in the zip; pack it again"
            ) from error
        return read_photograph(data, f"the image {_printable(entry.filename)}")


def _open_zip(path: Path) -> zipfile.ZipFile:
    with path.open("rb") as file:
        if file.read(len(_ZIP)) != _ZIP:
            raise MaterialError(_NOT_A_BTF)
    try:
        with path.open("rb") as file, open_bounded(file, _MAX_DIRECTORY_BYTES):
            pass
        return zipfile.ZipFile(path)
    except LongDirectoryError:
        raise MaterialError(_TOO_MANY) from None
    except Exception as error:  # zipfile raises many kinds for damaged data
        raise MaterialError(_DAMAGED) from error


def _index_by_directions(entries: list[zipfile.ZipInfo]) -> dict[tuple[Direction, Direction], zipfile.ZipInfo]:
    """Images by view and light."""
    if len(entries) > _MAX_ENTRIES:
        raise MaterialError(_TOO_MANY)
    by_pair: dict[tuple[Direction, Direction], zipfile.ZipInfo] = {}
    for entry in entries:
        match = _NAME.search(entry.filename.rsplit("/", 1)[-1])
        if match is None or not entry.filename.lower().endswith(SUFFIXES):
            continue
        _check_entry(entry)
        light_theta, light_phi, view_theta, view_phi = (int(group) for group in match.groups())
        pair = (_direction(view_theta, view_phi), _direction(light_theta, light_phi))
        if pair in by_pair:
            raise MaterialError(f"two images have the directions of {_printable(entry.filename)}; remove one of them")
        by_pair[pair] = entry
    if not by_pair:
        raise MaterialError(_NOT_A_BTF)
    return by_pair


def _check_entry(entry: zipfile.ZipInfo) -> None:
    if entry.file_size > _MAX_IMAGE_BYTES:
        max_megabytes = _MAX_IMAGE_BYTES >> 20
        raise MaterialError(
            f"the image {_printable(entry.filename)} is larger than {max_megabytes} MB; scale the images down"
        )
    if entry.flag_bits & 1:
        raise MaterialError("the zip is encrypted; pack it without a password")
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise MaterialError("the zip has an unsupported compression; pack it with deflate")


def _printable(name: str) -> str:
    """The end of a file name, for messages."""
    return "".join(character if character.isprintable() else "?" for character in name[-_MAX_NAME_LENGTH:])


def _direction(theta: int, phi: int) -> Direction:
    """A direction in a name; at the pole φ is ignored."""
    if theta >= 90 or phi > 360:
        raise missing_direction(theta, phi)
    return theta, 0 if theta == 0 else phi % 360
