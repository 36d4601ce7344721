"""A picture window by window, so that what is found of it is never there all at once.

Windows are squares whose sides are a power of two, in the order of a Morton curve: what is sorted along the curve in
each of them is, one after another, sorted along it in all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

TILE_SIZE = 256  # of a window, pixels; a power of two
MAX_CONCURRENT_TILES = 4  # windows at most that are looked at by a thread each: a hundred megabytes each


class ImageTile(NamedTuple):
    """A rectangle of a picture.

    Attributes:
        x, y: its first column and row. width, height: pixels.
    """

    x: int
    y: int
    width: int
    height: int

    def pixels(self, size: tuple[int, int]) -> NDArray[np.int64]:
        """Row-major numbers, in a picture of some size, of its pixels, row by row. (width · height,)"""
        rows = np.arange(self.y, self.y + self.height)[:, None] * size[0]
        return (rows + np.arange(self.x, self.x + self.width)).ravel()

    def padded(self, size: tuple[int, int]) -> ImageTile:
        """This and the pixels beside it, as far as a picture of some size has any."""
        x, y = max(0, self.x - 1), max(0, self.y - 1)
        right, bottom = min(size[0], self.x + self.width + 1), min(size[1], self.y + self.height + 1)
        return ImageTile(x, y, right - x, bottom - y)

    def crop_from(self, padded: ImageTile, values: NDArray[np.generic]) -> NDArray[np.generic]:
        """What is this window's of what a wider one's pixels have. values: (pixels of the wider one,)"""
        x, y = self.x - padded.x, self.y - padded.y
        padded_image = values.reshape(padded.height, padded.width)
        return padded_image[y : y + self.height, x : x + self.width].ravel()


def morton(pixel: NDArray[np.int64], width: int) -> NDArray[np.uint64]:
    """Interleave the bits of x and y: the order of a Z-curve.

    Args:
        pixel: row-major numbers. (n,) width: of the picture.
    Returns:
        (n,) uint64
    """
    code = np.zeros(len(pixel), np.uint64)
    x, y = (pixel % width).astype(np.uint64), (pixel // width).astype(np.uint64)
    for bit in range(14):
        bit_mask = np.uint64(1)
        code |= ((x >> np.uint64(bit)) & bit_mask) << np.uint64(2 * bit)
        code |= ((y >> np.uint64(bit)) & bit_mask) << np.uint64(2 * bit + 1)
    return code


def image_tiles(size: tuple[int, int]) -> list[ImageTile]:
    """The windows of a picture. size: width and height, pixels."""
    columns, rows = (-(-length // TILE_SIZE) for length in size)
    order = np.argsort(morton(np.arange(columns * rows), columns), kind="stable")
    return [
        ImageTile(x, y, min(TILE_SIZE, size[0] - x), min(TILE_SIZE, size[1] - y))
        for y, x in (
            (TILE_SIZE * int(row), TILE_SIZE * int(column)) for row, column in (divmod(k, columns) for k in order)
        )
    ]
