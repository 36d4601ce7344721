"""OpenEXR writer: named channels, in strips, with attributes; half floats unless full ones are requested."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from relume.core.filesystem import atomic_write

F64 = NDArray[np.float64]
Precision = Literal["half", "float"]
Channels = Sequence[tuple[str, NDArray[np.floating]]]
Attributes = Mapping[str, str | float | F64]

_TYPES = {"half": OpenImageIO.HALF, "float": OpenImageIO.FLOAT}
MAX_HALF = 65504.0
_STRIP_ROWS = 64


def image_channels(image: NDArray[np.floating], layer: str = "") -> Channels:
    """Channels of an image, (height, width, 3 or 4): R, G, B and A, or those of a layer."""
    prefix = f"{layer}." if layer else ""
    return [(prefix + name, image[..., c]) for c, name in enumerate("RGBA"[: image.shape[2]])]


def write_exr(
    path: Path,
    channels: Channels,
    attributes: Attributes,
    precision: Precision = "half",
    full_floats: Collection[str] = (),
) -> None:
    """Write a file atomically.

    Args:
        path: the file, which is replaced.
        channels, attributes, precision, full_floats: as for `write_scanlines`.
    Raises:
        RelumeError: the file cannot be written.
    """
    with atomic_write(path) as unfinished:
        write_scanlines(unfinished, channels, attributes, precision, full_floats)


def write_scanlines(
    path: Path,
    channels: Channels,
    attributes: Attributes,
    precision: Precision,
    full_floats: Collection[str] = (),
) -> None:
    """Write one scan-line part.

    Args:
        path: the file.
        channels: name, such as "R" or "light_Key.R", and values, (height, width), possibly memory-mapped.
        attributes: text, numbers, vectors, and matrices (4, 4) in OpenEXR's convention of row vectors.
        precision: float type of the values; half clamps them to 65,504.
        full_floats: channels with 32-bit floats, whatever the precision.
    Raises:
        OSError: the file cannot be written.
    """
    height, width = channels[0][1].shape
    specification = OpenImageIO.ImageSpec(width, height, len(channels), _TYPES[precision])
    specification.channelnames = tuple(name for name, _ in channels)
    types = ["float" if name in full_floats else precision for name, _ in channels]
    specification.channelformats = tuple(OpenImageIO.TypeDesc(name) for name in types)
    is_half = np.array([name == "half" for name in types])
    specification.attribute("compression", "zip")
    for name, value in attributes.items():
        _add(specification, name, value)
    output = OpenImageIO.ImageOutput.create(str(path))
    if output is None or not output.open(str(path), specification):
        raise OSError(OpenImageIO.geterror() if output is None else output.geterror())
    is_written = True
    for first in range(0, height, _STRIP_ROWS):
        last = min(first + _STRIP_ROWS, height)
        strip = np.stack([values[first:last] for _, values in channels], axis=-1).astype(np.float32)
        np.minimum(strip, MAX_HALF, out=strip, where=is_half)
        is_written = is_written and output.write_scanlines(first, last, 0, strip)
    if not output.close() or not is_written:
        raise OSError(output.geterror())


def _add(specification: OpenImageIO.ImageSpec, name: str, value: str | float | F64) -> None:
    if isinstance(value, np.ndarray):
        kind = OpenImageIO.TypeDesc("matrix" if value.ndim == 2 else f"float[{len(value)}]")
        specification.attribute(name, kind, tuple(map(float, value.ravel())))
    else:
        specification.attribute(name, value)
