"""One sample of each square of pixels that a material is seen in, and which of those each sample is like."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from relume.parallel import num_threads
from relume.views.view import View

F32 = NDArray[np.float32]

_PIXELS_A_TURN = 10.0  # a unit of normals counts as so many squares of pixels


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

    Args:
        view, material, step: of `one_of_each_square`, whose `chosen` samples are looked among.
        num: how many of them each takes, at most. soft: pixels²; the nearest share a sample where they are as near as
            this.
    Returns:
        Which of the chosen, and how much of each; rows sum to one. (n, k) int32 and float32
    """
    y, x = np.divmod(view.pixel[view.rows(material)].astype(np.int64), view.width)
    turn = _PIXELS_A_TURN * step * view.points(material).normal
    place = np.concatenate([np.stack([x, y], axis=1), turn], axis=1)
    num = min(num, len(chosen))
    distance, near = cKDTree(place[chosen]).query(place, k=list(range(1, num + 1)), workers=num_threads())
    weight = 1 / (distance**2 + soft)
    weight /= weight.sum(axis=1, keepdims=True)
    return near.astype(np.int32), weight.astype(np.float32)


def _squares(view: View, material: int, step: int) -> NDArray[np.int64]:
    """The square that each sample of a material is in. (n,)"""
    y, x = np.divmod(view.pixel[view.rows(material)].astype(np.int64), view.width)
    return np.asarray(y // step * view.width + x // step, np.int64)
