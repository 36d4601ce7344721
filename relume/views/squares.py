"""One sample of each square of pixels that a material is seen in, and which of those each sample is like."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.parallel import for_shares
from relume.views.view import View

F32 = NDArray[np.float32]

_PIXELS_A_TURN = 10.0  # a unit of normals counts as so many squares of pixels
_FAR = np.float32(1e30)
_SQUARES_ABOUT = 2  # in each direction, that a sample looks for chosen ones in


def num_squares(view: View, material: int, step: int) -> int:
    """Count the squares that a material is seen in.

    Args:
        view: by which it is seen. material: its index. step: side of a square, pixels.
    """
    seen = np.zeros(view.width * view.height, np.bool_)
    seen[_squares(view, material, step)] = True
    return int(np.count_nonzero(seen))


def one_of_each_square(view: View, material: int, step: int) -> NDArray[np.intp]:
    """Choose a sample of each square; counted from the material's first, rising. (squares,)

    Args:
        view: whose samples. material: its index. step: side of a square, pixels.
    """
    _, chosen = np.unique(_squares(view, material, step), return_index=True)
    return np.sort(chosen)  # samples of one level of roughness lie together


def nearest(
    view: View, material: int, chosen: NDArray[np.intp], step: int, num: int, soft: float
) -> tuple[NDArray[np.int32], F32]:
    """Find what each sample of a material takes of chosen ones: the nearest, by place in the picture and by normal.

    Those of the sample's own square and of the squares about it, two in each direction, are looked among.

    Args:
        view, material, step: of `one_of_each_square`, whose `chosen` samples they are.
        num: how many of them each takes, at most. soft: pixels²; the nearest share a sample where they are as near as
            this.
    Returns:
        Which of the chosen, and how much of each; rows sum to one, and where there are fewer the last take nothing.
        (n, k) int32 and float32
    """
    of_material = view.rows(material)
    y, x = np.divmod(view.pixel[of_material].astype(np.int64), view.width)
    turn = _PIXELS_A_TURN * step * view.store.read(f"views/{view.index}/normal", of_material.start, of_material.stop)
    place = np.concatenate([x[:, None], y[:, None], turn], axis=1, dtype=np.float32)
    columns, rows = -(-view.width // step), -(-view.height // step)
    of_square = np.full((rows, columns), -1, np.int32)
    of_square[y[chosen] // step, x[chosen] // step] = np.arange(len(chosen))
    num = min(num, len(chosen))
    near, weight = np.zeros((len(place), num), np.int32), np.zeros((len(place), num), np.float32)
    few = place[chosen]
    for_shares(lambda start, stop: _nearest(place, few, of_square, step, soft, start, stop, near, weight), len(place))
    return near, weight


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _nearest(
    place: F32, few: F32, of_square: NDArray[np.int32], step: int, soft: float, start: int, stop: int,
    near: NDArray[np.int32], weight: F32,
) -> None:  # fmt: skip
    """Fill `near` and `weight`, (n, k), for samples [start, stop), by distance in `place`, (n, 5): pixels, turn.

    Args:
        few: `place` of the chosen. of_square: which of them is in each square of step × step pixels, -1 for none.
    """
    rows, columns = of_square.shape
    num = near.shape[1]
    squared = np.empty(num, np.float32)
    for s in range(start, stop):
        squared[:] = _FAR
        column, row = int(place[s, 0]) // step, int(place[s, 1]) // step
        for i in range(max(0, row - _SQUARES_ABOUT), min(rows, row + _SQUARES_ABOUT + 1)):
            for j in range(max(0, column - _SQUARES_ABOUT), min(columns, column + _SQUARES_ABOUT + 1)):
                one = of_square[i, j]
                if one < 0:
                    continue
                d = np.float32(0)
                for k in range(5):
                    d += (place[s, k] - few[one, k]) ** 2
                k = num - 1
                if d >= squared[k]:
                    continue
                while k > 0 and d < squared[k - 1]:
                    squared[k], near[s, k] = squared[k - 1], near[s, k - 1]
                    k -= 1
                squared[k], near[s, k] = d, one
        total = np.float32(0)
        for k in range(num):
            weight[s, k] = 1 / (squared[k] + soft) if squared[k] < _FAR else 0
            total += weight[s, k]
        for k in range(num):
            weight[s, k] /= total


def _squares(view: View, material: int, step: int) -> NDArray[np.int64]:
    """The square that each sample of a material is in. (n,)"""
    y, x = np.divmod(view.pixel[view.rows(material)].astype(np.int64), view.width)
    return np.asarray(y // step * view.width + x // step, np.int64)
