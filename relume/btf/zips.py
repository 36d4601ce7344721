"""Zip files of images whose names say light and view: "… tl030 pl060 tv045 pv270.jpg", degrees of θ and φ (Bonn).

Read with Pillow, never unpacked; sizes are bounded before anything is decoded. Images are sRGB, a byte a channel; what
the BTF keeps is linear.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from relume.btf.compress import MOST_TEXELS
from relume.btf.found import found_rings
from relume.btf.rings import MOST_DIRECTIONS
from relume.color import srgb_decode
from relume.errors import MaterialError

F32 = NDArray[np.float32]

_NAME = re.compile(r"tl(\d{1,3})[ _]?pl(\d{1,3})[ _]?tv(\d{1,3})[ _]?pv(\d{1,3})", re.IGNORECASE)
_SUFFIXES = (".jpg", ".jpeg", ".png")
_MOST_ENTRIES = MOST_DIRECTIONS**2 + 1000
_MOST_IMAGE_BYTES = 16 << 20
_FORMATS = ("JPEG", "PNG")
_DEEP = ("I", "F")  # modes that begin so have 16 or 32 bits, which would be cut off at a byte
_UNREADABLE = (
    OSError, ValueError, SyntaxError, zipfile.BadZipFile, RuntimeError, NotImplementedError,
    Image.DecompressionBombError, Image.DecompressionBombWarning,
)  # fmt: skip
_WRONG = (
    "the file is not a zip of images that are named by their directions, such as 'tl030 pl060 tv045 pv270.jpg', "
    "and no .btf container either"
)

Direction = tuple[int, int]


class ZippedBtf:
    """The images of a zip; implements `relume.btf.compress.Images` but for keeping what it has read.

    Args:
        path: of the file.
    Raises:
        MaterialError: it is no such file, or images are missing, doubled, or of different sizes.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._zip = zipfile.ZipFile(path)
        except (OSError, zipfile.BadZipFile) as error:
            raise MaterialError(_WRONG) from error
        if len(self._zip.infolist()) > _MOST_ENTRIES:
            raise MaterialError(f"the zip has more than {_MOST_ENTRIES:,} files")
        self._by_pair = _named(self._zip.infolist())
        seen, lit = ({pair[k] for pair in self._by_pair} for k in (0, 1))
        if seen != lit:
            raise MaterialError("light and view directions of the BTF are not the same")
        given = sorted(lit)
        self.rings, order = found_rings(*np.array(given, np.float64).T)
        self._order = [given[number] for number in order]
        self._check_complete()
        self.size = self._read(self._order[0], self._order[0]).shape[:2]

    def _check_complete(self) -> None:
        pairs = ((view, light) for view in self._order for light in self._order)
        missing = [pair for pair in pairs if pair not in self._by_pair]
        if missing:
            (view, light), others = missing[0], len(missing) - 1
            more = f"; it is the first of {others + 1:,}" if others else ""
            raise MaterialError(
                f"the image with light from {light} and seen from {view} (degrees of θ and φ) is missing{more}"
            )

    def seen_from(self, view: int) -> F32:
        """Every texel's values from one direction. (lights, texels, 3) float32"""
        seen = self._order[view]
        return np.stack([self._read(seen, light).reshape(-1, 3) for light in self._order])

    def _read(self, view: Direction, light: Direction) -> F32:
        """One image, linear. (height, width, 3)"""
        name = self._by_pair[view, light]
        try:
            with self._zip.open(name) as file, Image.open(file, formats=_FORMATS) as image:
                if image.width * image.height > MOST_TEXELS:
                    raise MaterialError(f"{name[:100]} has more than {MOST_TEXELS:,} texels")
                if getattr(self, "size", None) not in (None, (image.height, image.width)):
                    raise MaterialError(f"{name[:100]} has another size than the first image")
                if image.mode.startswith(_DEEP):
                    raise MaterialError(f"{name[:100]} has more than a byte a channel; write it with one, as sRGB")
                pixels = np.asarray(image.convert("RGB"))
        except MaterialError:
            raise
        except _UNREADABLE as error:
            raise MaterialError(f"{name[:100]} cannot be read as an image") from error
        return np.asarray(srgb_decode(pixels.astype(np.float32) / np.float32(255)), np.float32)


def _named(entries: Iterable[zipfile.ZipInfo]) -> dict[tuple[Direction, Direction], str]:
    """Names of images by their view and light."""
    found: dict[tuple[Direction, Direction], str] = {}
    for entry in entries:
        match = _NAME.search(entry.filename.rsplit("/", 1)[-1])
        if match is None or not entry.filename.lower().endswith(_SUFFIXES):
            continue
        if entry.file_size > _MOST_IMAGE_BYTES:
            raise MaterialError(f"{entry.filename[:100]} is larger than {_MOST_IMAGE_BYTES >> 20} MB")
        light_theta, light_phi, view_theta, view_phi = (int(group) for group in match.groups())
        pair = (_direction(view_theta, view_phi), _direction(light_theta, light_phi))
        if pair in found:
            raise MaterialError(f"two images have the directions of {entry.filename[:100]}")
        found[pair] = entry.filename
    if not found:
        raise MaterialError(_WRONG)
    return found


def _direction(theta: int, phi: int) -> Direction:
    """A direction of a name; at the pole φ says nothing."""
    if theta >= 90 or phi > 360:
        raise MaterialError(
            f"a direction of the BTF lies at θ = {theta}°, φ = {phi}°: at or below the horizon, or nowhere"
        )
    return theta, 0 if theta == 0 else phi % 360
