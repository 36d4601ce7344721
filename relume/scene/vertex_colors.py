"""Colours of vertices as an image: a square block of texels for each triangle.

Texel (i, j) of a block of s × s holds c0 + i/(s − 1) (c1 − c0) + j/(s − 1) (c2 − c0), which bilinear look-ups continue
exactly: so that colours are what the file says, and everything that reads textures reads them. Texels beyond the
triangle's third edge may be no colours, and are held to [0, 1]; where that is seen blocks are 4 × 4 texels, else 2 × 2.
Blocks lie along a Morton curve: what is seen from far is the mean of triangles that follow each other in the file,
which mostly are neighbours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.core.color import srgb_encode

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]

MAX_COLORED = 4_000_000
"""Triangles whose corners have colours of their own in one material; of more, the mean is taken."""
WRAP = ("clamp", "clamp")
_MAX_LARGE_BLOCKS = 1_000_000  # triangles in larger blocks
_MAX_UNIFORM_RANGE = 1.5 / 255  # of display values
_MAX_OVERSHOOT = 0.05  # beyond [0, 1], in linear values


def is_uniform(colors: F32) -> bool:
    """Whether colours (n, 4) differ by less than an image of bytes tells."""
    display = np.concatenate([srgb_encode(colors[:, :3]), colors[:, 3:]], axis=1)
    return bool(np.ptp(display, axis=0).max() < _MAX_UNIFORM_RANGE)


def draw_color_image(corners: F32) -> tuple[U8, F32, F32]:
    """Draw the colours of triangles.

    Args:
        corners: linear RGB and alpha, within [0, 1]. (n, 3, 4), n at least 1
    Returns:
        The image, sRGB and alpha, (height, width, 4); where the corners lie in it, v from the top, (n, 3, 2); and a
        place that is white. (2,)
    """
    first, along, down = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    fourth_corner = first + along + down
    needs_large_block = np.abs(fourth_corner - np.clip(fourth_corner, 0, 1)).max() > _MAX_OVERSHOOT
    side = 4 if needs_large_block and len(corners) <= _MAX_LARGE_BLOCKS else 2
    block = np.arange(len(corners) + 1, dtype=np.int64)  # the first one is white
    x, y = side * _deinterleave(block), side * _deinterleave(block >> 1)
    height, width = int(y.max()) + side, int(x.max()) + side
    image = np.full((height, width, 4), 255, np.uint8)
    for i, j in np.ndindex(side, side):
        values = np.clip(first + (i * along + j * down) / np.float32(side - 1), 0, 1)
        display = np.concatenate([srgb_encode(values[:, :3]), values[:, 3:]], axis=1)
        image[y[1:] + j, x[1:] + i] = np.round(255 * display)
    centers = np.stack([x, y], axis=-1)[:, None] + 0.5
    uvs = (centers + (side - 1) * np.array([[0, 0], [1, 0], [0, 1]])) / [width, height]
    return image, uvs[1:].astype(np.float32), uvs[0, 0].astype(np.float32)


def _deinterleave(code: NDArray[np.int64]) -> NDArray[np.int64]:
    """Every second bit of Morton codes below 2³², from the lowest."""
    bits = code & 0x55555555
    for shift, mask in ((1, 0x33333333), (2, 0x0F0F0F0F), (4, 0x00FF00FF), (8, 0x0000FFFF)):
        bits = (bits | (bits >> shift)) & mask
    return bits
