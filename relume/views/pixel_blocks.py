"""One view sample per block of pixels of a material, and interpolation of all samples from them.

The error of linear interpolation grows with (κ s)², κ the change of the normal from pixel to pixel and s the side of
the blocks. Of all sides with the same number of blocks, s ∝ κ^(−2/3) have the least sum of squared errors.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.thread_pools import map_ordered, parallel_for_chunks
from relume.views.view import View

F32 = NDArray[np.float32]

_BLOCKS_PER_NORMAL_UNIT = 10.0  # blocks of distance that count as much as a unit of normal difference
_MAX_DISTANCE = np.float32(1e30)
_BLOCK_RADIUS = 2  # search radius in blocks
_LEAST_PART = np.float32(0.999)  # of the farthest neighbor's weight, which is subtracted from all
_LEAST_CHANGE = 0.05  # of a normal: light varies on flat surfaces, too


def num_blocks(view: View, material: int, block_size: int) -> int:
    """Count the pixel blocks in which a material is visible.

    Args:
        view: the view. material: its index. block_size: side of a block, pixels.
    """
    is_occupied = np.zeros(view.width * view.height, np.bool_)
    is_occupied[_block_index(view, material, block_size)] = True
    return int(np.count_nonzero(is_occupied))


def block_sizes(view: View, num_blocks: int) -> Shaped[NDArray[np.int64], " materials"]:
    """Return sides of blocks for all materials, in pixels: small ones where surfaces bend.

    Args:
        view: the view. num_blocks: approximate number of blocks of all materials.
    """
    key = view.key, view.name, "change of normals"
    change = view.cache.transient.get_value(key, lambda: _normal_changes(view))
    num_samples = np.diff(view.bounds[: len(change) + 1])
    side = np.sqrt(np.sum(num_samples * change ** (4 / 3)) / num_blocks) * change ** (-2 / 3)
    return np.asarray(np.maximum(np.rint(side), 1), np.int64)


def _normal_changes(view: View) -> Shaped[NDArray[np.float64], " materials"]:
    """RMS difference κ of the normals of adjacent pixels in a row, of each material; at least `_LEAST_CHANGE`."""

    def change(material: int) -> float:
        pixel, first = np.unique(view.pixel[view.rows(material)], return_index=True)
        normal = view.normals(material)[first]
        is_adjacent = np.diff(pixel.astype(np.int64)) == 1
        squared = np.square(np.diff(normal, axis=0)[is_adjacent], dtype=np.float64).sum(axis=1)
        return max(_LEAST_CHANGE, float(np.sqrt(squared.mean())) if len(squared) else 0.0)

    materials = range(len(view.bounds) - 1)
    return np.array(list(map_ordered(change, materials, len(materials))))


def one_per_block(view: View, material: int, block_size: int) -> Shaped[NDArray[np.intp], " blocks"]:
    """Choose one sample per block; ascending indices from the material's first sample.

    Args:
        view: the view. material: its index. block_size: side of a block, pixels.
    """
    _, first_rows = np.unique(_block_index(view, material, block_size), return_index=True)
    return np.sort(first_rows)  # samples of one roughness level are adjacent


def nearest_chosen(
    view: View,
    material: int,
    subset: Shaped[NDArray[np.intp], " blocks"],
    block_size: int,
    num_neighbors: int,
    softening: float,
) -> tuple[Shaped[NDArray[np.int32], "n k"], Shaped[F32, "n k"]]:
    """Find the nearest chosen samples of each sample of a material, by pixel position and normal, and their weights.

    Searches the sample's own block and the blocks around it, up to two in each direction. Weights fall to nearly zero
    at the farthest neighbor, 1 / d² − 1 / d_far² (modified Shepard interpolation), so that images are smooth where the
    neighbors change.

    Args:
        view, material, block_size: as in `one_per_block`, which returned `subset`.
        num_neighbors: maximum number of neighbors. softening: pixels², added to squared distances in the weights.
    Returns:
        Indices into `subset`, and weights; rows sum to one, and missing neighbors have zero weight.
    """
    rows = view.rows(material)
    y, x = np.divmod(view.pixel[rows].astype(np.int64), view.width)
    scaled_normal = _BLOCKS_PER_NORMAL_UNIT * block_size * view.normals(material)
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
    """Fill `neighbors` and `weight`, (n, k), of samples [start, stop), by distance of `features`, (n, 5).

    Args:
        features: pixel position and scaled normal. subset_features: features of the chosen samples.
        block_sample: index of the chosen sample in each block, -1 for none.
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
        farthest = _LEAST_PART / (best_squared[num_neighbors - 1] + softening)
        for k in range(num_neighbors):
            weight[s, k] = 1 / (best_squared[k] + softening) - farthest if best_squared[k] < _MAX_DISTANCE else 0
            total += weight[s, k]
        for k in range(num_neighbors):
            weight[s, k] /= total


def _block_index(view: View, material: int, block_size: int) -> NDArray[np.int64]:
    """Index of each sample's pixel block. (n,)"""
    y, x = np.divmod(view.pixel[view.rows(material)].astype(np.int64), view.width)
    return np.asarray(y // block_size * view.width + x // block_size, np.int64)
