"""One sample of each square of pixels that a material is seen in, and which of those each sample is like."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.thread_pools import parallel_for_chunks
from relume.views.view import View

F32 = NDArray[np.float32]

_BLOCKS_PER_NORMAL_UNIT = 10.0  # a unit of normals counts as so many squares of pixels
_MAX_DISTANCE = np.float32(1e30)
_BLOCK_RADIUS = 2  # in each direction, that a sample looks for chosen ones in


def num_blocks(view: View, material: int, block_size: int) -> int:
    """Count the squares that a material is seen in.

    Args:
        view: by which it is seen. material: its index. block_size: side of a square, pixels.
    """
    is_occupied = np.zeros(view.width * view.height, np.bool_)
    is_occupied[_block_index(view, material, block_size)] = True
    return int(np.count_nonzero(is_occupied))


def one_per_block(view: View, material: int, block_size: int) -> NDArray[np.intp]:
    """Choose a sample of each square; counted from the material's first, rising. (squares,)

    Args:
        view: whose samples. material: its index. block_size: side of a square, pixels.
    """
    _, first_rows = np.unique(_block_index(view, material, block_size), return_index=True)
    return np.sort(first_rows)  # samples of one level of roughness lie together


def nearest_chosen(
    view: View, material: int, subset: NDArray[np.intp], block_size: int, num_neighbors: int, softening: float
) -> tuple[NDArray[np.int32], F32]:
    """Find what each sample of a material takes of chosen ones: the nearest, by place in the picture and by normal.

    Those of the sample's own square and of the squares about it, two in each direction, are looked among.

    Args:
        view, material, block_size: of `one_per_block`, whose `subset` samples they are.
        num_neighbors: how many of them each takes, at most. softening: pixels²; the nearest share a sample where they
            are as near as this.
    Returns:
        Which of the chosen, and how much of each; rows sum to one, and where there are fewer the last take nothing.
        (n, k) int32 and float32
    """
    rows = view.rows(material)
    y, x = np.divmod(view.pixel[rows].astype(np.int64), view.width)
    scaled_normal = (
        _BLOCKS_PER_NORMAL_UNIT * block_size * view.store.read(f"views/{view.index}/normal", rows.start, rows.stop)
    )
    features = np.concatenate([x[:, None], y[:, None], scaled_normal], axis=1, dtype=np.float32)
    num_columns, num_rows = -(-view.width // block_size), -(-view.height // block_size)
    block_sample = np.full((num_rows, num_columns), -1, np.int32)
    block_sample[y[subset] // block_size, x[subset] // block_size] = np.arange(len(subset))
    num_neighbors = min(num_neighbors, len(subset))
    neighbors, weight = (
        np.zeros((len(features), num_neighbors), np.int32),
        np.zeros((len(features), num_neighbors), np.float32),
    )
    subset_features = features[subset]
    parallel_for_chunks(
        lambda start, stop: _find_nearest(
            features, subset_features, block_sample, block_size, softening, start, stop, neighbors, weight
        ),
        len(features),
    )
    return neighbors, weight


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _find_nearest(
    features: F32, subset_features: F32, block_sample: NDArray[np.int32], block_size: int, softening: float,
    start: int, stop: int,
    neighbors: NDArray[np.int32], weight: F32,
) -> None:  # fmt: skip
    """Fill `neighbors` and `weight`, (n, k), of samples [start, stop), by distance in `features`, (n, 5): pixels, turn.

    Args:
        subset_features: `features` of the chosen. block_sample: which of them is in each square of step × step pixels,
            -1 for none.
    """
    rows, columns = block_sample.shape
    num_neighbors = neighbors.shape[1]
    best_squared = np.empty(num_neighbors, np.float32)
    for s in range(start, stop):
        best_squared[:] = _MAX_DISTANCE
        column, row = int(features[s, 0]) // block_size, int(features[s, 1]) // block_size
        for i in range(max(0, row - _BLOCK_RADIUS), min(rows, row + _BLOCK_RADIUS + 1)):
            for j in range(max(0, column - _BLOCK_RADIUS), min(columns, column + _BLOCK_RADIUS + 1)):
                candidate = block_sample[i, j]
                if candidate < 0:
                    continue
                squared_distance = np.float32(0)
                for k in range(5):
                    squared_distance += (features[s, k] - subset_features[candidate, k]) ** 2
                k = num_neighbors - 1
                if squared_distance >= best_squared[k]:
                    continue
                while k > 0 and squared_distance < best_squared[k - 1]:
                    best_squared[k], neighbors[s, k] = best_squared[k - 1], neighbors[s, k - 1]
                    k -= 1
                best_squared[k], neighbors[s, k] = squared_distance, candidate
        total = np.float32(0)
        for k in range(num_neighbors):
            weight[s, k] = 1 / (best_squared[k] + softening) if best_squared[k] < _MAX_DISTANCE else 0
            total += weight[s, k]
        for k in range(num_neighbors):
            weight[s, k] /= total


def _block_index(view: View, material: int, block_size: int) -> NDArray[np.int64]:
    """The square that each sample of a material is in. (n,)"""
    y, x = np.divmod(view.pixel[view.rows(material)].astype(np.int64), view.width)
    return np.asarray(y // block_size * view.width + x // block_size, np.int64)
