"""Coinciding nodes of a lattice share one probe, however many there are."""

import numpy as np
from numpy.typing import NDArray

from relume.probes.lattice_nodes import (
    _NORMAL_STEP_EXCESS,
    _POSITION_BITS,
    _U64,
    NodeTable,
    _keys,
    num_representatives,
    representative_nodes,
)
from relume.raytrace.surface_points import SurfacePoints


def keys_numpy(
    grid_nodes: NodeTable, merge_distance: float, normal_steps: int
) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Reference of the node keys in plain NumPy.

    Args:
        grid_nodes: of all grids. merge_distance: fraction of the spacing within which nodes are merged.
        normal_steps: quantization steps of the components of a unit normal.
    Returns:
        Two keys that coinciding nodes have in common. (n,) uint64 each
    """
    level = np.rint(np.log2(grid_nodes.spacing / grid_nodes.spacing.min())).astype(np.uint64)
    size = np.maximum(merge_distance * grid_nodes.spacing, grid_nodes.extent / ((1 << _POSITION_BITS) - 1))
    box = np.floor(grid_nodes.position / size[:, None]).astype(np.uint64)
    normal_code = np.rint(grid_nodes.surface_points.normal * np.float32(normal_steps + _NORMAL_STEP_EXCESS))
    normal_code = normal_code.astype(np.int64) + normal_steps
    base = 2 * normal_steps + 1
    kind = (((normal_code[:, 0] * base + normal_code[:, 1]) * base + normal_code[:, 2]) * 2 + grid_nodes.side).astype(
        np.uint64
    )
    position_key = (box[:, 0] << _U64(2 * _POSITION_BITS)) | (box[:, 1] << _U64(_POSITION_BITS)) | box[:, 2]
    return position_key, (kind << _U64(24)) | (level << _U64(16)) | grid_nodes.material.astype(np.uint64)


def nodes(num, seed=3):
    """Nodes on a coarse raster, so that many coincide, of two materials, on both sides, of three spacings."""
    rng = np.random.default_rng(seed)
    normal = rng.choice(np.array([[0, 0, 1], [0, 1, 0], [0.6, -0.8, 0]], np.float32), num)
    position = rng.integers(-9, 9, (num, 3)).astype(np.float32) + rng.normal(scale=0.02, size=(num, 3))
    points = SurfacePoints(position.astype(np.float32), normal, normal[:, [1, 2, 0]], np.zeros(num, np.uint32))
    material, side = rng.integers(0, 2, num).astype(np.uint16), rng.integers(0, 2, num).astype(np.uint8)
    spacing, piece = 0.3 * 2.0 ** rng.integers(0, 3, num), np.zeros(num, np.int32)
    from_corner = points.position.astype(np.float64) - points.position.min(axis=0)
    is_candidate, extent = rng.random(num) < 0.8, float(from_corner.max())
    return NodeTable(points, from_corner, material, side, piece, spacing, is_candidate, extent)


def test_keys_equal_numpy():
    some = nodes(3000)
    for together, alike in ((0.35, 4), (1e-3, 50)):
        for actual, expected in zip(_keys(some, together, alike), keys_numpy(some, together, alike), strict=True):
            np.testing.assert_array_equal(actual, expected)


def test_the_number_of_shared_nodes_is_predicted():
    some = nodes(20_000)
    for alike in (1, 4):
        count = len(representative_nodes(some, alike))
        assert 100 < count < 20_000
        assert num_representatives(some, alike) == count
