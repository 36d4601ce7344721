"""Thumbnails of environments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from PIL import Image

from relume.core.color import luminance
from relume.core.filesystem import atomic_write
from relume.image_io.downsample import downsample
from relume.image_io.tone_mapping import tone_map
from relume.image_io.write_image import png_bytes, to_bytes

WIDTH, HEIGHT = 192, 96
_GRAY = 0.18  # display value of the geometric mean, which a sun hardly affects


def thumbnail(radiance: Shaped[NDArray[np.float32], "height width 3"]) -> bytes:
    """Return a tone-mapped PNG of an equirectangular map, exposed for its geometric mean."""
    height, width, _ = radiance.shape
    small = downsample(radiance, (min(WIDTH, width), min(HEIGHT, height)))
    light = luminance(small)
    mean = float(np.exp(np.mean(np.log(light[light > 0], dtype=np.float64))))
    display = Image.fromarray(to_bytes(tone_map(small, float(np.log2(_GRAY / mean)), "agx")))
    return png_bytes(np.asarray(display.resize((WIDTH, HEIGHT), Image.Resampling.BILINEAR)))


def write_thumbnail(path: Path, radiance: Shaped[NDArray[np.float32], "height width 3"]) -> None:
    """Write the thumbnail as a PNG file, atomically."""
    with atomic_write(path) as unfinished:
        unfinished.write_bytes(thumbnail(radiance))
