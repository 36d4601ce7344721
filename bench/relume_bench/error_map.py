"""Images for docs/indirect-light.md: indirect light by relume and by Mitsuba, and their difference."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from relume_bench.gather_scenes import Pair, render_pair

F64 = NDArray[np.float64]

_BLOCK = 4  # pixels per side: leaves a quarter of Mitsuba's noise
_FULL = 0.1  # of the RMS is full color
_WHITE = 3.0  # of it is white


def side_by_side(pair: Pair) -> NDArray[np.uint8]:
    """Ours, Mitsuba's, and the difference: red too bright, blue too dark. (height, 3 width, 3)"""
    reference = pair.passes.mean(axis=0, dtype=np.float64)
    scale = np.sqrt(np.mean(reference**2))
    display_images = [np.clip(image / (_WHITE * scale), 0, 1) ** (1 / 2.2) for image in (pair.rendered, reference)]
    signed_error = np.clip(_average_blocks(pair.rendered - reference).mean(axis=-1) / (_FULL * scale), -1, 1)
    color = np.stack(
        [1 - np.maximum(-signed_error, 0), 1 - abs(signed_error), 1 - np.maximum(signed_error, 0)], axis=-1
    )
    display_images.append(color.repeat(_BLOCK, axis=0).repeat(_BLOCK, axis=1))
    return np.asarray(255 * np.concatenate(display_images, axis=1) + 0.5, np.uint8)


def _average_blocks(image: F64) -> F64:
    height, width, channels = image.shape
    blocks = image.reshape(height // _BLOCK, _BLOCK, width // _BLOCK, _BLOCK, channels)
    return np.asarray(blocks.mean(axis=(1, 3)))


if __name__ == "__main__":
    Image.fromarray(side_by_side(render_pair(sys.argv[1]))).save(Path(sys.argv[2]), quality=88, optimize=True)
