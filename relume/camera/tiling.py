"""Tiles of an image, so that its samples are never in memory all at once.

Tiles are squares whose side is a power of two, in Morton order: samples sorted along the Morton curve within each tile
are sorted along it over all tiles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

TILE_SIZE = 256  # pixels; a power of two
MAX_CONCURRENT_TILES = 4  # one thread each; a tile needs about a hundred megabytes


class ImageTile(NamedTuple):
    """A rectangle of an image.

    Attributes:
        x, y: first column and row. width, height: in pixels.
    """

    x: int
    y: int
    width: int
    height: int

    def pixels(self, size: tuple[int, int]) -> Shaped[NDArray[np.int64], " pixels"]:
        """Row-major indices of the tile's pixels in an image of `size`. (width · height,)"""
        rows = np.arange(self.y, self.y + self.height)[:, None] * size[0]
        return (rows + np.arange(self.x, self.x + self.width)).ravel()

    def padded(self, size: tuple[int, int]) -> ImageTile:
        """Tile with a border of one pixel, clipped to an image of `size`."""
        x, y = max(0, self.x - 1), max(0, self.y - 1)
        right, bottom = min(size[0], self.x + self.width + 1), min(size[1], self.y + self.height + 1)
        return ImageTile(x, y, right - x, bottom - y)

    def crop_from(
        self, padded: ImageTile, values: Shaped[NDArray[np.generic], " padded_pixels"]
    ) -> Shaped[NDArray[np.generic], " pixels"]:
        """Crop values of a padded tile to this tile."""
        x, y = self.x - padded.x, self.y - padded.y
        padded_image = values.reshape(padded.height, padded.width)
        return padded_image[y : y + self.height, x : x + self.width].ravel()


def morton(pixel: Shaped[NDArray[np.int64], " n"], width: int) -> Shaped[NDArray[np.uint64], " n"]:
    """Morton codes of pixels: interleaved bits of x and y.

    Args:
        pixel: row-major indices. width: width of the image.
    """
    code = np.zeros(len(pixel), np.uint64)
    x, y = (pixel % width).astype(np.uint64), (pixel // width).astype(np.uint64)
    for bit in range(14):
        bit_mask = np.uint64(1)
        code |= ((x >> np.uint64(bit)) & bit_mask) << np.uint64(2 * bit)
        code |= ((y >> np.uint64(bit)) & bit_mask) << np.uint64(2 * bit + 1)
    return code


def image_tiles(size: tuple[int, int], tile_size: int | None = None) -> list[ImageTile]:
    """Tiles of an image, in Morton order.

    Args:
        size: width and height in pixels. tile_size: a power of two, pixels; None: `TILE_SIZE`.
    """
    tile_size = tile_size or TILE_SIZE
    columns, rows = (-(-length // tile_size) for length in size)
    order = np.argsort(morton(np.arange(columns * rows), columns), kind="stable")
    return [
        ImageTile(x, y, min(tile_size, size[0] - x), min(tile_size, size[1] - y))
        for y, x in (
            (tile_size * int(row), tile_size * int(column)) for row, column in (divmod(k, columns) for k in order)
        )
    ]
