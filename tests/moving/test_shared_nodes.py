"""Nodes of a lattice that lie together are one point, however many there are."""

import numpy as np

from relume.live.free_camera.probes.lattice_nodes import (
    NodeTable,
    _keys,
    bounding_cube,
    keys_numpy,
    num_representatives,
    representative_nodes,
)
from relume.raytrace.surface_points import SurfacePoints


def nodes(num, seed=3):
    """Nodes on a coarse raster, so that many lie together, of two materials, on both sides, of three spacings."""
    rng = np.random.default_rng(seed)
    normal = rng.choice(np.array([[0, 0, 1], [0, 1, 0], [0.6, -0.8, 0]], np.float32), num)
    position = rng.integers(-9, 9, (num, 3)).astype(np.float32) + rng.normal(scale=0.02, size=(num, 3))
    points = SurfacePoints(position.astype(np.float32), normal, normal[:, [1, 2, 0]], np.zeros(num, np.uint32))
    material, side = rng.integers(0, 2, num).astype(np.uint16), rng.integers(0, 2, num).astype(np.uint8)
    spacing, piece = 0.3 * 2.0 ** rng.integers(0, 3, num), np.zeros(num, np.int32)
    return NodeTable(points, material, side, piece, spacing, rng.random(num) < 0.8, *bounding_cube(points))


def test_keys_are_those_of_numpy():
    some = nodes(3000)
    for together, alike in ((0.35, 4), (1e-3, 50)):
        for found, expected in zip(_keys(some, together, alike), keys_numpy(some, together, alike), strict=True):
            np.testing.assert_array_equal(found, expected)


def test_nodes_that_are_shared_are_counted_as_they_are_found():
    some = nodes(20_000)
    for alike in (1, 4):
        found = len(representative_nodes(some, alike))
        assert 100 < found < 20_000
        assert num_representatives(some, alike) == found
