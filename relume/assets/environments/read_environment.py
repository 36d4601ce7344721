"""Import of panoramas in .hdr and .exr files from untrusted sources."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.panoramas import ANGULAR_MAP, find_panorama, is_panorama_size, to_equirectangular
from relume.assets.environments.radiance_file import is_radiance, read_radiance_file
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported, with_subject
from relume.image_io.downsample import downsample
from relume.image_io.fill_texels import fill_from_neighbors
from relume.image_io.orientation import TRANSPOSED, orient
from relume.image_io.primaries import convert
from relume.image_io.read_linear import EXR_MAGIC, LinearReader

F32 = NDArray[np.float32]

MAX_WIDTH, MAX_HEIGHT = 16_384, 8_192
SCENE_MAX_WIDTH = 4096  # texels of 0.09°, which take some hundred bytes each during a bake
MAX_FILE_BYTES = 400_000_000
MAX_RADIANCE = 1e6
_STRIP_ROWS = 64


def read_environment(
    source: str | Path | bytes, name: str, max_width: int = SCENE_MAX_WIDTH, *, is_mirror_ball: bool = False
) -> Environment:
    """Read a panorama in a .hdr or .exr image.

    Args:
        source: a path or the file's bytes.
        name: name in messages.
        max_width: limit in texels; wider maps are scaled down to it.
        is_mirror_ball: a square map is a mirror ball, not an angular map.
    Returns:
        The environment, equirectangular and in linear Rec. 709 for any projection and any primaries of the file, with
        one warning for each kind of change: NaN texels become the mean of valid neighbors, infinite ones the largest
        number, negative values 0, radiance is clamped to 1e6, other projections are resampled, and wide maps are scaled
        down.
    Raises:
        SceneError: the file is missing, empty, damaged, too large, black, no panorama, or neither .hdr nor .exr.
    """
    data = _read_bytes(source, name)
    if not data:
        raise SceneError(f"environment {name!r} is empty: 0 bytes; export or download it again")
    reader = _MapReader(name, max_width, is_mirror_ball=is_mirror_ball)
    if data.startswith(EXR_MAGIC):
        reader.read_exr(data)
    elif is_radiance(data):
        reader.read_radiance(data)
    else:
        raise SceneError(f"environment {name!r} is neither Radiance .hdr nor OpenEXR; convert it to one of them")
    return reader.environment()


class _MapReader:
    """Reads a map in strips of rows, and repairs and downsamples each by an integer factor."""

    def __init__(self, name: str, max_width: int, *, is_mirror_ball: bool) -> None:
        self._name, self._max_width, self._is_mirror_ball = name, max_width, is_mirror_ball
        self._strip_pixels: list[F32] = []
        self._warnings: list[ImporterWarning] = []
        self._num_broken = self._num_negative = self._num_texels = 0
        self._is_bright = self._is_openexr_cube = False
        self._orientation, self._reduction, self._width = 1, 1, 0

    def read_radiance(self, data: bytes) -> None:
        """Read a Radiance file."""
        file = read_radiance_file(data, self._label, self._check_size)
        self._orientation = file.orientation
        self._add_warnings(file.warnings)
        self._read_strips(LinearReader(file.data, ".hdr", self._label), file.to_rec_709)

    def read_exr(self, data: bytes) -> None:
        """Read an OpenEXR file."""
        reader = LinearReader(data, ".exr", self._label)
        self._read_strips(reader, None)
        self._is_openexr_cube = reader.is_openexr_cube

    def environment(self) -> Environment:
        """Return the environment with its warnings."""
        label, environment, warnings = self._label, f"environment {quote(self._name)}", self._warnings
        if self._num_broken == self._num_texels:
            raise SceneError(f"no texel of {label} is a number; render or export it again")
        if self._num_broken:
            message = f"{self._num_broken:,} NaN texels of {environment} were replaced by the mean of their neighbors."
            warnings.append(unsupported(message))
        if self._num_negative:
            warnings.append(approximated(f"{self._num_negative:,} negative texels of {environment} were set to 0."))
        if self._is_bright:
            warnings.append(approximated(f"Values of {environment} above {MAX_RADIANCE:g} were clamped."))
        pixels = self._strip_pixels[0] if len(self._strip_pixels) == 1 else np.concatenate(self._strip_pixels)
        if not pixels.any():
            raise SceneError(f"{label} is black everywhere; choose one with light")
        radiance = self._limit_width(self._equirectangular(orient(pixels, self._orientation)))
        return Environment(self._name, np.ascontiguousarray(radiance), tuple(warnings))

    @property
    def _label(self) -> str:
        return f"environment {self._name!r}"

    def _add_warnings(self, predicates: Iterable[ImporterWarning]) -> None:
        self._warnings += with_subject(f"Environment {quote(self._name)}", predicates)

    def _read_strips(self, reader: LinearReader, matrix: NDArray[np.float64] | None) -> None:
        """Read all strips. matrix: conversion to radiance in Rec. 709; None if the decoder has already converted."""
        for strip in reader.strips(self._rows):
            if matrix is not None:
                convert(strip, matrix)
            height, width, _ = strip.shape
            self._strip_pixels.append(
                downsample(self._repair(strip), (width // self._reduction, height // self._reduction))
            )
        self._add_warnings(reader.warnings)

    def _rows(self, width: int, height: int) -> int:
        """Rows of a strip. width, height: of the stored map, whose rows may be columns"""
        is_transposed = self._orientation in TRANSPOSED
        self._width = self._check_size(*((height, width) if is_transposed else (width, height)))
        reduction = max(1, self._width // self._max_width)
        if reduction == 1 or height % reduction or {width, height} != {self._width, self._width // 2}:
            return height
        self._reduction = reduction
        return min(height, reduction * max(1, _STRIP_ROWS // reduction))

    def _check_size(self, width: int, height: int) -> int:
        """Return the width. Raises SceneError for images that are too large or no panoramas."""
        sides = sorted((width, height))
        if not (1 <= sides[0] <= MAX_HEIGHT and sides[1] <= MAX_WIDTH):
            raise SceneError(
                f"{self._label} is {width}×{height} pixels, the limit is {MAX_WIDTH}×{MAX_HEIGHT}; scale it down"
            )
        if not is_panorama_size(width, height):
            raise self._shape_error(width, height)
        return width

    def _shape_error(self, width: int, height: int) -> SceneError:
        return SceneError(
            f"{self._label} is {width}×{height}, not 2:1; use an equirectangular map, a cross of cube faces (4:3 or "
            "3:4) or an angular map (1:1) with blank corners, or six cube faces (6:1 or 1:6)"
        )

    def _repair(self, pixels: F32) -> F32:
        is_broken = np.asarray(np.isnan(pixels).any(axis=-1))
        self._num_texels += is_broken.size
        self._num_negative += int((pixels < 0).any(axis=-1).sum())
        self._is_bright |= bool((pixels > MAX_RADIANCE).any())
        np.clip(pixels, 0, MAX_RADIANCE, out=pixels)  # in place: a map that is not downsampled may have 1.6 GB
        if is_broken.any():
            self._num_broken += int(is_broken.sum())
            fill_from_neighbors(pixels, is_broken)
        return pixels

    def _equirectangular(self, pixels: F32) -> F32:
        height, width, _ = pixels.shape
        if width == 2 * height:
            return pixels
        panorama = find_panorama(pixels, is_openexr_cube=self._is_openexr_cube, is_mirror_ball=self._is_mirror_ball)
        if panorama is None:
            raise self._shape_error(width, height)
        radiance = to_equirectangular(panorama, pixels, min(panorama.width, self._max_width // 2 * 2))
        size = f"{radiance.shape[1]}×{radiance.shape[0]}"
        message = f"is {width}×{height}: it was read as {panorama.name} and resampled to {size}"
        is_certain = panorama.name != ANGULAR_MAP
        doubt = "" if is_certain else "; a mirror ball has the same shape and must be converted before"
        self._add_warnings([(approximated if is_certain else unsupported)(f"{message}{doubt}.")])
        self._width = radiance.shape[1]
        return radiance

    def _limit_width(self, radiance: F32) -> F32:
        if self._width <= self._max_width:
            return radiance
        size = self._max_width, self._max_width // 2
        scaling = f"from {self._width}×{self._width // 2} to {size[0]}×{size[1]}"
        self._add_warnings([approximated(f"was scaled {scaling}.")])
        return downsample(radiance, size)


def _read_bytes(source: str | Path | bytes, name: str) -> bytes:
    if isinstance(source, bytes):
        size_bytes = len(source)
    else:
        try:
            size_bytes = Path(source).stat().st_size
        except OSError:
            raise SceneError(f"there is no environment file {Path(source).name!r}; check the path") from None
    if size_bytes > MAX_FILE_BYTES:
        limit_mb = MAX_FILE_BYTES / 1e6
        raise SceneError(
            f"environment {name!r} has {size_bytes / 1e6:,.0f} MB, the limit is {limit_mb:,.0f} MB; scale it down"
        )
    try:
        return source if isinstance(source, bytes) else Path(source).read_bytes()
    except OSError as problem:
        raise SceneError(f"environment {name!r} cannot be read ({problem.strerror}); check the file") from None
