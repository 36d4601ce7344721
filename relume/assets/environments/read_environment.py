"""Import of equirectangular .hdr and .exr files from untrusted sources."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.hdr_header import read_header
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported
from relume.image_io.downsample import downsample
from relume.image_io.primaries import convert
from relume.image_io.read_linear import EXR_MAGIC, check_claim, read_strips

F32 = NDArray[np.float32]

MAX_WIDTH, MAX_HEIGHT = 16_384, 8_192
SCENE_MAX_WIDTH = 4096  # texels of 0.09°, which take some hundred bytes each during a bake
MAX_FILE_BYTES = 400_000_000
MAX_RADIANCE = 1e6
_STRIP_ROWS = 64


def read_environment(source: str | Path | bytes, name: str, max_width: int = SCENE_MAX_WIDTH) -> Environment:
    """Read an equirectangular .hdr or .exr image.

    Args:
        source: a path or the file's bytes.
        name: name in messages.
        max_width: limit in texels; wider maps are scaled down to it.
    Returns:
        The environment, in linear Rec. 709 for any primaries of the file, with one warning for each kind of repair:
        non-finite texels become black, negative values 0, radiance is clamped to 1e6, and wide maps are scaled down.
    Raises:
        SceneError: the file is missing, empty, damaged, too large, black, not 2:1, or neither .hdr nor .exr.
    """
    data = _read_bytes(source, name)
    if not data:
        raise SceneError(f"environment {name!r} is empty: 0 bytes; export or download it again")
    reader = _MapReader(name, max_width)
    if data.startswith(b"#?"):
        reader.radiance(data)
    elif data.startswith(EXR_MAGIC):
        reader.strips(data, ".exr")
    else:
        raise SceneError(f"environment {name!r} is neither Radiance .hdr nor OpenEXR; convert it to one of them")
    return _limit_width(reader.environment(), reader.width, max_width)


class _MapReader:
    """Reads a map in strips of rows, and repairs and downsamples each by an integer factor.

    Attributes:
        width: width of the map in the file.
    """

    def __init__(self, name: str, max_width: int) -> None:
        self._name, self._max_width = name, max_width
        self._strip_pixels: list[F32] = []
        self._warnings: list[ImporterWarning] = []
        self._num_broken = self._num_negative = self._num_texels = 0
        self._is_bright = False
        self.width, self._reduction = 0, 1

    def radiance(self, data: bytes) -> None:
        """Read a Radiance file."""
        header = read_header(data, self._name)
        _check_size(self._name, header.width, header.height)
        check_claim(header.width * header.height * 12, data, f"environment {self._name!r}")
        self.strips(data, ".hdr", header.to_rec_709)
        if header.has_odd_primaries:
            warning = f"Environment {quote(self._name)} has invalid color primaries; it was read as linear Rec. 709."
            self._warnings.append(approximated(warning))

    def strips(self, data: bytes, suffix: str, matrix: NDArray[np.float64] | None = None) -> None:
        """Read all strips. matrix: conversion to Rec. 709; None if the decoder has already converted."""
        for strip in read_strips(data, suffix, f"environment {self._name!r}", self._rows):
            if matrix is not None:
                convert(strip, matrix)
            height, width, _ = strip.shape
            self._strip_pixels.append(
                downsample(self._repair(strip), (width // self._reduction, height // self._reduction))
            )

    def _rows(self, width: int, height: int) -> int:
        _check_size(self._name, width, height)
        self.width, reduction = width, max(1, width // self._max_width)
        if reduction == 1 or height % reduction:
            return height
        self._reduction = reduction
        return min(height, reduction * max(1, _STRIP_ROWS // reduction))

    def _repair(self, pixels: F32) -> F32:
        broken = np.logical_not(np.isfinite(pixels).all(axis=-1, keepdims=True))
        self._num_texels += broken.size
        if broken.any():
            self._num_broken += int(broken.sum())
            pixels = np.where(broken, np.float32(0), pixels)
        self._num_negative += int((pixels < 0).any(axis=-1).sum())
        self._is_bright |= bool((pixels > MAX_RADIANCE).any())
        np.clip(pixels, 0, MAX_RADIANCE, out=pixels)  # in place: a map that is not downsampled may have 1.6 GB
        return pixels

    def environment(self) -> Environment:
        """Return the environment with its warnings."""
        label, warnings = f"environment {self._name!r}", list(self._warnings)
        environment = f"environment {quote(self._name)}"
        if self._num_broken == self._num_texels:
            raise SceneError(f"no texel of {label} is a finite number; render or export it again")
        if self._num_broken:
            warnings.append(
                unsupported(f"{self._num_broken:,} NaN or infinite texels of {environment} were made black.")
            )
        if self._num_negative:
            warnings.append(approximated(f"{self._num_negative:,} negative texels of {environment} were set to 0."))
        if self._is_bright:
            warnings.append(approximated(f"Values of {environment} above {MAX_RADIANCE:g} were clamped."))
        pixels = self._strip_pixels[0] if len(self._strip_pixels) == 1 else np.concatenate(self._strip_pixels)
        if not pixels.any():
            raise SceneError(f"{label} is black everywhere; choose one with light")
        return Environment(self._name, pixels, tuple(warnings))


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


def _check_size(name: str, width: int, height: int) -> None:
    if not (1 <= width <= MAX_WIDTH and 1 <= height <= MAX_HEIGHT):
        raise SceneError(
            f"environment {name!r} is {width}×{height} pixels, the limit is {MAX_WIDTH}×{MAX_HEIGHT}; scale it down"
        )
    if width != 2 * height:
        raise SceneError(f"environment {name!r} is {width}×{height}, not 2:1; use an equirectangular map")


def _limit_width(environment: Environment, width: int, max_width: int) -> Environment:
    """Scale down to `max_width`. width: width of the map in the file, before `_MapReader` downsampled it."""
    if width <= max_width:
        return environment
    size = max_width, max_width // 2
    warning = f"Environment {quote(environment.name)} was scaled from {width}×{width // 2} to {size[0]}×{size[1]}."
    return Environment(
        environment.name, downsample(environment.radiance, size), (*environment.warnings, approximated(warning))
    )
