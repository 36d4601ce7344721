"""Vertex colors as a texture: a square block of texels for each triangle.

Texel (i, j) of a block of s × s holds c0 + i/(s − 1) (c1 − c0) + j/(s − 1) (c2 − c0), so that bilinear lookups give the
exact interpolated color, and everything that reads textures supports vertex colors. Texels beyond the triangle's third
edge are clamped to [0, 1]; if that would be visible, blocks have 4 × 4 texels, otherwise 2 × 2. Blocks follow a Morton
curve: minification averages triangles that are consecutive in the file, which are usually neighbors.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_encode

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]

MAX_COLORED = 4_000_000
"""Maximum number of triangles with vertex colors in one material; beyond, their mean is used."""
WRAP = ("clamp", "clamp")
_MAX_LARGE_BLOCKS = 1_000_000  # triangles in larger blocks
_MAX_UNIFORM_RANGE = 1.5 / 255  # in sRGB
_MAX_OVERSHOOT = 0.05  # beyond [0, 1], linear


def is_uniform(colors: Shaped[F32, "n 4"]) -> bool:
    """True if RGBA colors differ by less than 8 bits can represent."""
    display = np.concatenate([srgb_encode(colors[:, :3]), colors[:, 3:]], axis=1)
    return bool(np.ptp(display, axis=0).max() < _MAX_UNIFORM_RANGE)


def draw_color_image(
    corners: Shaped[F32, "triangles 3 4"],
) -> tuple[Shaped[U8, "height width 4"], Shaped[F32, "triangles 3 2"], Shaped[F32, " 2"]]:
    """Draw the vertex colors of triangles into an image.

    Args:
        corners: linear RGB and alpha in [0, 1], of at least one triangle.
    Returns:
        The image in sRGB with alpha; UV coordinates of the corners, v from the top; and those of a white texel.
    """
    first, along, down = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    fourth_corner = first + along + down
    needs_large_block = np.abs(fourth_corner - np.clip(fourth_corner, 0, 1)).max() > _MAX_OVERSHOOT
    side = 4 if needs_large_block and len(corners) <= _MAX_LARGE_BLOCKS else 2
    block = np.arange(len(corners) + 1, dtype=np.int64)  # the first is white
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
    """Even bits of Morton codes below 2³²."""
    bits = code & 0x55555555
    for shift, mask in ((1, 0x33333333), (2, 0x0F0F0F0F), (4, 0x00FF00FF), (8, 0x0000FFFF)):
        bits = (bits | (bits >> shift)) & mask
    return bits
