"""A picture window by window, so that what is found of it is never there all at once.

Windows are squares whose sides are a power of two, in the order of a Morton curve: what is sorted along the curve in
each of them is, one after another, sorted along it in all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SIDE = 256  # of a window, pixels; a power of two
AT_ONCE = 4  # windows at most that are looked at by a thread each: a hundred megabytes each


class Window(NamedTuple):
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

    def widened(self, size: tuple[int, int]) -> Window:
        """This and the pixels beside it, as far as a picture of some size has any."""
        x, y = max(0, self.x - 1), max(0, self.y - 1)
        right, bottom = min(size[0], self.x + self.width + 1), min(size[1], self.y + self.height + 1)
        return Window(x, y, right - x, bottom - y)

    def cut_from(self, wider: Window, values: NDArray[np.generic]) -> NDArray[np.generic]:
        """What is this window's of what a wider one's pixels have. values: (pixels of the wider one,)"""
        x, y = self.x - wider.x, self.y - wider.y
        of_wider = values.reshape(wider.height, wider.width)
        return of_wider[y : y + self.height, x : x + self.width].ravel()


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
        one = np.uint64(1)
        code |= ((x >> np.uint64(bit)) & one) << np.uint64(2 * bit)
        code |= ((y >> np.uint64(bit)) & one) << np.uint64(2 * bit + 1)
    return code


def windows_of(size: tuple[int, int]) -> list[Window]:
    """The windows of a picture. size: width and height, pixels."""
    columns, rows = (-(-length // SIDE) for length in size)
    order = np.argsort(morton(np.arange(columns * rows), columns), kind="stable")
    return [
        Window(x, y, min(SIDE, size[0] - x), min(SIDE, size[1] - y))
        for y, x in ((SIDE * int(row), SIDE * int(column)) for row, column in (divmod(k, columns) for k in order))
    ]
