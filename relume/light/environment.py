"""Equirectangular environments: the direction of a texel, and reading .hdr and .exr files that may be hostile."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813  (the name its own documentation gives it)
from numpy.typing import NDArray

from relume.errors import SceneError
from relume.scene.model import F32, Environment
from relume.scene.remarks import simplified, wrong

F64 = NDArray[np.float64]

MAX_WIDTH, MAX_HEIGHT = 16_384, 8_192
MAX_FILE_BYTES = 400_000_000
MAX_RADIANCE = 1e6
MAX_EXPANSION = 1_000  # deflate packs zeros 1,032 : 1; no photograph comes near it
FREE_BYTES = 64 << 20  # may be claimed by any file, however small
HDR_RESOLUTION = re.compile(rb"-Y\s+(\d{1,9})\s+\+X\s+(\d{1,9})\s*\Z")
EXR_MAGIC = b"\x76\x2f\x31\x01"


def texel_directions(height: int, width: int) -> F32:
    """Unit direction of each texel's centre: u = atan2(z, x)/2π + ½, v = ½ − asin(y)/π. (height, width, 3)"""
    u = (np.arange(width) + 0.5) / width
    v = (np.arange(height) + 0.5) / height
    return uv_to_direction(*np.meshgrid(u, v)).astype(np.float32)


def texel_solid_angles(height: int, width: int) -> F64:
    """Solid angle of the texels of each row, exact, in steradian; they sum to 4π / width. (height,)"""
    edges = np.sin(np.pi * (0.5 - np.arange(height + 1) / height))
    return (2 * np.pi / width) * (edges[:-1] - edges[1:])


def uv_to_direction(u: F64, v: F64) -> F64:
    """Unit direction of (u, v) in [0, 1]², v from the top. (..., 3)"""
    phi, elevation = 2 * np.pi * (u - 0.5), np.pi * (0.5 - v)
    horizontal = np.cos(elevation)
    return np.stack([horizontal * np.cos(phi), np.sin(elevation), horizontal * np.sin(phi)], -1)


def direction_to_uv(w: NDArray[np.floating]) -> tuple[F64, F64]:
    """(u, v) in [0, 1]² of unit directions (..., 3), v from the top."""
    direction = np.asarray(w, np.float64)
    u = np.arctan2(direction[..., 2], direction[..., 0]) / (2 * np.pi) + 0.5
    return u, 0.5 - np.arcsin(np.clip(direction[..., 1], -1, 1)) / np.pi


def shrunk(radiance: F32, width: int) -> F32:
    """An equirectangular map halved, by means of 2 × 2 texels, until it is at most so wide or has an odd side."""
    while radiance.shape[1] > width and radiance.shape[0] % 2 == radiance.shape[1] % 2 == 0:
        radiance = 0.25 * (radiance[::2, ::2] + radiance[1::2, ::2] + radiance[::2, 1::2] + radiance[1::2, 1::2])
    return radiance


def turned(direction: F64, degrees: float) -> F64:
    """Directions turned about +Y, counter-clockwise seen from above. (n, 3)"""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.asarray(direction @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]))


def read_environment(source: str | Path | bytes, name: str) -> Environment:
    """Reads an equirectangular .hdr or .exr image.

    Args:
        source: a path or the file's bytes.
        name: what people call it.

    Returns:
        The environment with one warning for each thing that was repaired: texels that are not finite become black,
        negative values 0, and radiance is held below 1e6.

    Raises:
        SceneError: no such file, neither format, damaged, too large, not 2:1, or without any light.
    """
    data = _read_bytes(source, name)
    if data.startswith(b"#?"):
        suffix, (width, height) = ".hdr", _hdr_size(data, name)
        _check_size(width, height, name)
        _check_claim(width * height * 12, data, name)
    elif data.startswith(EXR_MAGIC):
        suffix = ".exr"
    else:
        raise SceneError(f"environment {name!r} is neither Radiance .hdr nor OpenEXR; convert it to one of them")
    return _repaired(_read_pixels(data, suffix, name), name)


def _read_bytes(source: str | Path | bytes, name: str) -> bytes:
    if isinstance(source, bytes):
        size_bytes = len(source)
    else:
        try:
            size_bytes = Path(source).stat().st_size
        except OSError:
            raise SceneError(f"there is no environment file {Path(source).name!r}; check the path") from None
    if size_bytes > MAX_FILE_BYTES:
        raise SceneError(f"environment {name!r} has {size_bytes / 1e6:,.0f} MB, 400 MB are allowed; scale it down")
    try:
        return source if isinstance(source, bytes) else Path(source).read_bytes()
    except OSError as problem:
        raise SceneError(f"environment {name!r} cannot be read ({problem.strerror}); check the file") from None


def _hdr_size(data: bytes, name: str) -> tuple[int, int]:
    """Width and height from a Radiance header: lines of at most 2 kB, an empty one, then `-Y height +X width`."""
    lines = data[:65_536].split(b"\n")
    try:
        resolution = lines[lines.index(b"") + 1]
    except (ValueError, IndexError):
        raise SceneError(f"environment {name!r} has no Radiance header; export it again") from None
    found = HDR_RESOLUTION.match(resolution)
    if found is None or max(len(line) for line in lines[: lines.index(b"")]) > 2_048:
        raise SceneError(f"environment {name!r} has an odd Radiance header; save it top row first")
    return int(found[2]), int(found[1])


def _check_size(width: int, height: int, name: str) -> None:
    if not (1 <= width <= MAX_WIDTH and 1 <= height <= MAX_HEIGHT):
        raise SceneError(
            f"environment {name!r} is {width}×{height}; at most {MAX_WIDTH}×{MAX_HEIGHT} pixels are read; scale it"
        )
    if width != 2 * height:
        raise SceneError(f"environment {name!r} is {width}×{height}; an equirectangular map is twice as wide as high")


def _check_claim(claimed_bytes: int, data: bytes, name: str) -> None:
    """A header of a few bytes may claim gigabytes; what is made of it is held to what the file could unpack to."""
    if claimed_bytes > max(FREE_BYTES, MAX_EXPANSION * len(data)):
        raise SceneError(
            f"environment {name!r} claims {claimed_bytes / 1e6:,.0f} MB of pixels and holds {len(data) / 1e6:,.1f} MB; "
            "it is truncated or damaged, export it again"
        )


def _check_tiles(spec: oiio.ImageSpec, data: bytes, name: str) -> None:
    """Tiles that can be in the file: each has 8 bytes in its table, and the decoder holds a whole one."""
    if spec.tile_width == 0:
        return
    num_tiles = -(-spec.width // spec.tile_width) * -(-spec.height // spec.tile_height)
    if 8 * num_tiles > len(data):
        raise SceneError(f"environment {name!r} has more tiles than data; it is damaged, export it again")
    _check_claim(spec.tile_width * spec.tile_height * spec.nchannels * 4, data, name)


def _read_pixels(data: bytes, suffix: str, name: str) -> F32:
    """Lets OpenImageIO decode from a private temporary file, header first, pixels only when the size is allowed."""
    handle, path = tempfile.mkstemp(suffix=suffix)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        image = oiio.ImageInput.open(path)
        if image is None:
            _forget_error(oiio.geterror)
            raise SceneError(f"environment {name!r} is damaged or not what its first bytes say; export it again")
        try:
            return _read_open_image(image, data, name)
        except UnicodeDecodeError:  # names in the header that are no text
            raise SceneError(f"environment {name!r} is damaged; export it again") from None
        finally:
            image.close()
    finally:
        Path(path).unlink()


def _read_open_image(image: oiio.ImageInput, data: bytes, name: str) -> F32:
    spec = image.spec()
    _check_size(spec.width, spec.height, name)
    if spec.depth != 1 or spec.deep or not 1 <= spec.nchannels <= 16:
        raise SceneError(f"environment {name!r} is deep or has {spec.nchannels} channels; save it as plain RGB")
    names = [channel.rpartition(".")[2].upper() for channel in spec.channelnames]
    order = [names.index(c) for c in "RGB"] if {"R", "G", "B"} <= set(names) else [0, 0, 0]
    first, last = min(order), max(order)
    if last - first > 3 and spec.width * spec.height > 1 << 24:
        raise SceneError(f"environment {name!r} has channels between its RGB; save it as plain RGB")
    _check_tiles(spec, data, name)
    _check_claim(spec.width * spec.height * (last + 1 - first) * 4, data, name)
    pixels = image.read_image(0, 0, first, last + 1, oiio.FLOAT)
    if pixels is None:
        _forget_error(image.geterror)
        raise SceneError(f"environment {name!r} ends early or is damaged; export it again")
    return np.ascontiguousarray(np.asarray(pixels, np.float32)[..., [channel - first for channel in order]])


def _forget_error(take_error: Callable[[], str]) -> None:
    """OpenImageIO keeps its message until it is asked for; the message may quote bytes that are no text."""
    with suppress(UnicodeDecodeError):
        take_error()


def _repaired(pixels: F32, name: str) -> Environment:
    warnings = []
    broken = np.logical_not(np.isfinite(pixels).all(axis=-1, keepdims=True))
    if broken.any():
        warnings.append(
            wrong(f"{int(broken.sum()):,} texels of environment {name!r} are not finite; they are black now")
        )
        pixels = np.where(broken, np.float32(0), pixels)
    negative = (pixels < 0).any(axis=-1)
    if negative.any():
        warnings.append(
            simplified(f"{int(negative.sum()):,} texels of environment {name!r} are negative; they are 0 there now")
        )
    if (pixels > MAX_RADIANCE).any():
        warnings.append(
            simplified(f"environment {name!r} is brighter than {MAX_RADIANCE:g} somewhere; it is held to that")
        )
    pixels = np.clip(pixels, 0, MAX_RADIANCE)
    if not pixels.any():
        raise SceneError(f"environment {name!r} is black everywhere; choose one with light in it")
    return Environment(name, pixels, tuple(warnings))


def lookup(radiance: F32, directions: F32) -> F32:
    """Radiance of an equirectangular map in unit directions (n, 3), bilinear, round about in u. (n, 3) float32"""
    height, width, _ = radiance.shape
    u, v = direction_to_uv(directions)
    x, y = u * width - 0.5, np.clip(v * height - 0.5, 0, height - 1)
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    left, right = x0.astype(np.intp) % width, (x0.astype(np.intp) + 1) % width
    upper = y0.astype(np.intp)
    lower = np.minimum(upper + 1, height - 1)
    top = radiance[upper, left] * (1 - fx) + radiance[upper, right] * fx
    bottom = radiance[lower, left] * (1 - fx) + radiance[lower, right] * fx
    return np.asarray(top * (1 - fy) + bottom * fy, np.float32)
