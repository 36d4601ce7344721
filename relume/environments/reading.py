"""Reading equirectangular .hdr and .exr files, which may be hostile."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.environments.model import Environment
from relume.environments.radiance_header import read_header
from relume.errors import SceneError
from relume.imageio.linear import EXR_MAGIC, check_claim, read_pixels
from relume.imageio.primaries import convert
from relume.imageio.shrink import shrink
from relume.remarks import Remark, simplified, wrong

F32 = NDArray[np.float32]

MAX_WIDTH, MAX_HEIGHT = 16_384, 8_192
OF_SCENES = 4096  # texels of 0.09°, some hundred bytes each while a bake divides them into light
MAX_FILE_BYTES = 400_000_000
MAX_RADIANCE = 1e6


def read_environment(source: str | Path | bytes, name: str, most_width: int = OF_SCENES) -> Environment:
    """Read an equirectangular .hdr or .exr image.

    Args:
        source: a path or the file's bytes.
        name: what people call it.
        most_width: it is kept at most so many texels wide, each the mean of those that it stands for.

    Returns:
        The environment, in linear Rec. 709 whatever the primaries that it tells, with one warning for each thing
        that was repaired: texels that are not finite become black, negative values 0, and radiance is held below 1e6;
        and one where it was reduced.

    Raises:
        SceneError: no such file, neither format, empty, damaged, too large, not 2:1, or without any light.
    """
    data, what = _read_bytes(source, name), f"environment {name!r}"
    if not data:
        raise SceneError(f"environment {name!r} is empty: 0 bytes; export or download it again")
    if data.startswith(b"#?"):
        pixels, said = _read_radiance(data, name, what)
    elif data.startswith(EXR_MAGIC):
        pixels, said = read_pixels(data, ".exr", what, partial(_check_size, name)), ()
    else:
        raise SceneError(f"environment {name!r} is neither Radiance .hdr nor OpenEXR; convert it to one of them")
    return _reduced(_repaired(pixels, name, said), most_width)


def _read_radiance(data: bytes, name: str, what: str) -> tuple[F32, tuple[Remark, ...]]:
    """Texels in linear Rec. 709, and what is to be said of them."""
    header = read_header(data, name)
    _check_size(name, header.width, header.height)
    check_claim(header.width * header.height * 12, data, what)
    pixels = read_pixels(data, ".hdr", what, partial(_check_size, name))
    if header.to_rec_709 is not None:
        convert(pixels, header.to_rec_709)
    odd = simplified(f"environment {name!r} tells primaries that are no colours; it is read as linear Rec. 709")
    return pixels, (odd,) * header.has_odd_primaries


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


def _check_size(name: str, width: int, height: int) -> None:
    if not (1 <= width <= MAX_WIDTH and 1 <= height <= MAX_HEIGHT):
        raise SceneError(
            f"environment {name!r} is {width}×{height}; at most {MAX_WIDTH}×{MAX_HEIGHT} pixels are read; scale it"
        )
    if width != 2 * height:
        raise SceneError(f"environment {name!r} is {width}×{height}; an equirectangular map is twice as wide as high")


def _repaired(pixels: F32, name: str, said: tuple[Remark, ...]) -> Environment:
    warnings = [*said]
    broken = np.logical_not(np.isfinite(pixels).all(axis=-1, keepdims=True))
    if broken.all():
        raise SceneError(f"no texel of environment {name!r} is a finite number; render or export it again")
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
