"""Image output: EXR contains linear radiance, PNG and WebP contain display values."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from relume.core.errors import ParameterError, ShapeMismatchError
from relume.core.filesystem import atomic_write
from relume.image_io.display_transform import DisplayTransform, to_display
from relume.image_io.exr_writer import image_channels, write_scanlines

F32 = NDArray[np.float32]
_DEFAULT = DisplayTransform()


def to_bytes(display: F32) -> NDArray[np.uint8]:
    """Round display values in [0, 1] to 0…255."""
    return (np.clip(display, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)


def png_bytes(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """Encode a PNG, 8 or 16 bits like the pixels: gray, RGB or RGBA. (height, width[, 3 or 4])"""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


def write_image(path: Path, image: F32, transform: DisplayTransform = _DEFAULT) -> None:
    """Write an image in the format of its suffix, atomically.

    Args:
        path: ends in .exr (linear radiance, float32; the display transform does not apply), .png or .webp (8 bit).
        image: linear Rec. 709 radiance, top row first, (height, width, 3 or 4), premultiplied if there is coverage as a
            fourth channel, as in EXR; the other formats contain colors that are not premultiplied.
        transform: conversion to display values.
    Raises:
        ParameterError: unknown format or tone map. ShapeMismatchError: neither RGB nor RGB with coverage.
        RelumeError: the file cannot be written.
    """
    write = _WRITERS.get(path.suffix.lower())
    if write is None:
        raise ParameterError("the image format", path.suffix, f"a file name ending in {', '.join(_WRITERS)}")
    if image.ndim != 3 or image.shape[2] not in (3, 4) or image.size == 0:
        raise ShapeMismatchError(f"an image has the shape (height, width, 3 or 4), not {image.shape}; reshape it")
    with atomic_write(path) as unfinished:
        write(unfinished, image, transform)


def _write_exr(path: Path, image: F32, transform: DisplayTransform) -> None:
    write_scanlines(path, image_channels(image), {"oiio:ColorSpace": "lin_rec709_scene"}, "float")


def _to_display_bytes(image: F32, transform: DisplayTransform) -> NDArray[np.uint8]:
    """Display values of the surfaces without premultiplication, and coverage."""
    alpha = np.clip(image[..., 3:], 0, 1)
    surfaces = image[..., :3] if image.shape[2] == 3 else image[..., :3] / np.maximum(alpha, 1e-6)
    display = to_display(np.asarray(surfaces, np.float32), transform)
    return np.concatenate([to_bytes(display), to_bytes(alpha)], axis=-1)


def _write_png(path: Path, image: F32, transform: DisplayTransform) -> None:
    tags = PngInfo()
    if isinstance(transform.tone_map, str) or "sRGB" in transform.tone_map.display:
        tags.add(b"sRGB", b"\x00")  # rendering intent: perceptual
    Image.fromarray(_to_display_bytes(image, transform)).save(path, "PNG", pnginfo=tags)


def _write_webp(path: Path, image: F32, transform: DisplayTransform) -> None:
    Image.fromarray(_to_display_bytes(image, transform)).save(path, "WEBP", quality=92, method=4)


_WRITERS: dict[str, Callable[[Path, F32, DisplayTransform], None]] = {
    ".exr": _write_exr,
    ".png": _write_png,
    ".webp": _write_webp,
}
