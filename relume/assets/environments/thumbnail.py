"""Small pictures of environments, as a list shows them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from relume.core.color import luminance
from relume.core.filesystem import atomic_write
from relume.image_io.downsample import downsample
from relume.image_io.tone_mapping import tone_map
from relume.image_io.write_image import png_bytes, to_bytes

WIDTH, HEIGHT = 192, 96
_GRAY = 0.18  # what the geometric mean becomes: a sun does not darken the rest


def thumbnail(radiance: NDArray[np.float32]) -> bytes:
    """A tone-mapped PNG, exposed for what most of the map shows.

    Args:
        radiance: equirectangular. (height, width, 3) float32
    """
    height, width, _ = radiance.shape
    small = downsample(radiance, (min(WIDTH, width), min(HEIGHT, height)))
    light = luminance(small)
    mean = float(np.exp(np.mean(np.log(light[light > 0], dtype=np.float64))))
    display = Image.fromarray(to_bytes(tone_map(small, float(np.log2(_GRAY / mean)), "agx")))
    return png_bytes(np.asarray(display.resize((WIDTH, HEIGHT), Image.Resampling.BILINEAR)))


def write_thumbnail(path: Path, radiance: NDArray[np.float32]) -> None:
    """Write the thumbnail as a PNG file, which appears whole or not at all."""
    with atomic_write(path) as unfinished:
        unfinished.write_bytes(thumbnail(radiance))
