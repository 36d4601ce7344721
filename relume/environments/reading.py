"""Reading equirectangular .hdr and .exr files, which may be hostile."""

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

from relume.environments.model import Environment
from relume.environments.primaries import convert, to_rec_709
from relume.errors import SceneError
from relume.imageio.shrink import shrink
from relume.remarks import simplified, wrong

F32 = NDArray[np.float32]

MAX_WIDTH, MAX_HEIGHT = 16_384, 8_192
OF_SCENES = 4096  # texels of 0.09°, some hundred bytes each while a bake divides them into light
MAX_FILE_BYTES = 400_000_000
MAX_RADIANCE = 1e6
MAX_EXPANSION = 1_000  # deflate packs zeros 1,032 : 1; no photograph comes near it
FREE_BYTES = 64 << 20  # may be claimed by any file, however small
HDR_RESOLUTION = re.compile(rb"-Y\s+(\d{1,9})\s+\+X\s+(\d{1,9})\s*\Z")
EXR_MAGIC = b"\x76\x2f\x31\x01"


def read_environment(source: str | Path | bytes, name: str, most_width: int = OF_SCENES) -> Environment:
    """Read an equirectangular .hdr or .exr image.

    Args:
        source: a path or the file's bytes.
        name: what people call it.
        most_width: it is kept at most so many texels wide, each the mean of those that it stands for.

    Returns:
        The environment, in linear Rec. 709 whatever the primaries that an .exr tells, with one warning for each thing
        that was repaired: texels that are not finite become black, negative values 0, and radiance is held below 1e6;
        and one where it was reduced.

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
    return _reduced(_repaired(_read_pixels(data, suffix, name), name), most_width)


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
    """Read width and height from a Radiance header: lines of at most 2 kB, an empty one, then `-Y height +X width`."""
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
    """Hold what a header claims to what the file could unpack to: a few bytes may claim gigabytes."""
    if claimed_bytes > max(FREE_BYTES, MAX_EXPANSION * len(data)):
        raise SceneError(
            f"environment {name!r} claims {claimed_bytes / 1e6:,.0f} MB of pixels and holds {len(data) / 1e6:,.1f} MB; "
            "it is truncated or damaged, export it again"
        )


def _check_tiles(spec: oiio.ImageSpec, data: bytes, name: str) -> None:
    """Hold tiles to what can be in the file: each has 8 bytes in its table, and the decoder holds a whole one."""
    if spec.tile_width == 0:
        return
    num_tiles = -(-spec.width // spec.tile_width) * -(-spec.height // spec.tile_height)
    if 8 * num_tiles > len(data):
        raise SceneError(f"environment {name!r} has more tiles than data; it is damaged, export it again")
    _check_claim(spec.tile_width * spec.tile_height * spec.nchannels * 4, data, name)


def _read_pixels(data: bytes, suffix: str, name: str) -> F32:
    """Let OpenImageIO decode from a private temporary file, header first, pixels only when the size is allowed."""
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
    matrix = _primaries_of(spec, name)
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
    found = np.asarray(pixels, np.float32)
    found = found if order == [first, first + 1, first + 2] else found[..., [channel - first for channel in order]]
    if matrix is not None and last > first:  # grey has no primaries
        convert(found, matrix)
    return found


def _primaries_of(spec: oiio.ImageSpec, name: str) -> NDArray[np.float64] | None:
    """What converts the file's colours to ours; None where they are."""
    told = spec.getattribute("chromaticities")
    if told is None:
        return None
    try:
        return to_rec_709(told)
    except (TypeError, ValueError) as problem:
        raise SceneError(f"environment {name!r} has odd primaries ({problem}); export it as linear Rec. 709") from None


def _forget_error(take_error: Callable[[], str]) -> None:
    """Take the message that OpenImageIO keeps until it is asked for; it may quote bytes that are no text."""
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
    np.clip(pixels, 0, MAX_RADIANCE, out=pixels)  # in place: a map of 16k is 1.6 GB
    if not pixels.any():
        raise SceneError(f"environment {name!r} is black everywhere; choose one with light in it")
    return Environment(name, pixels, tuple(warnings))


def _reduced(environment: Environment, most_width: int) -> Environment:
    height, width, _ = environment.radiance.shape
    if width <= most_width:
        return environment
    size = most_width, most_width // 2
    said = simplified(f"environment {environment.name!r} is {width}×{height}; it is kept as {size[0]}×{size[1]}")
    return Environment(environment.name, shrink(environment.radiance, size), (*environment.warnings, said))
