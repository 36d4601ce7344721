"""Parallax of a relief for view directions from several sides."""

import numpy as np
import pytest
from btf_reference import parallax_intersection_numpy

from relume.assets.btf.direction_rings import directions, ubo_grid
from relume.assets.btf.parallax import compute_shear, compute_shears, parallax_intersection, visible_texels
from relume.synthetic_btf.render import TileGeometry
from relume.synthetic_btf.weave import weave

SLANTS = [(0.0, 0.0), (0.4, -0.2), (-2.5, 1.5)]


def waves():
    """A texture of 24 × 32 texels, 0.07 high."""
    v, u = np.meshgrid((np.arange(24) + 0.5) / 24, (np.arange(32) + 0.5) / 32, indexing="ij")
    return (0.04 + 0.03 * np.sin(2 * np.pi * (u + v)) * np.cos(2 * np.pi * 2 * v)).astype(np.float32)


def intersect_relief(relief, uv, slant):
    slant = np.asarray(slant, np.float32)
    return float(parallax_intersection(relief, relief.min(), relief.max(), np.float32(uv[0]), np.float32(uv[1]), slant))


@pytest.mark.parametrize("slant", SLANTS)
def test_the_kernel_equals_the_reference_and_the_ray_relief_intersection(slant):
    relief, rng = waves(), np.random.default_rng(3)
    for uv in rng.uniform(-2, 2, (40, 2)):
        actual, exact = intersect_relief(relief, uv, slant), parallax_intersection_numpy(relief, uv, np.array(slant))
        assert abs(actual - exact) < 1e-5
        # by brute force: the interpolated relief in ten thousand steps
        z = np.linspace(relief.max(), relief.min(), 10_001)
        at = (uv + z[:, None] * slant * np.array([1, -1])) * [32, 24] - 0.5
        first = np.floor(at).astype(int)
        fraction, surface_height = at - first, np.zeros(len(z))
        for right, down in ((0, 0), (1, 0), (0, 1), (1, 1)):
            share = np.abs(1 - right - fraction[:, 0]) * np.abs(1 - down - fraction[:, 1])
            surface_height += share * relief[(first[:, 1] + down) % 24, (first[:, 0] + right) % 32]
        assert abs(actual - z[np.flatnonzero(z <= surface_height)[0]]) < 4e-4


def test_visible_texels_are_those_that_rays_meet():
    relief, rings = waves(), ubo_grid()
    visible = visible_texels(relief, rings, (24, 32))
    assert (visible[0] == np.arange(24 * 32)).all()  # from above
    for view, texel in np.random.default_rng(4).integers(0, (81, 24 * 32), (60, 2)):
        uv, shear = np.array([(texel % 32 + 0.5) / 32, (texel // 32 + 0.5) / 24]), compute_shears(rings)[view]
        met = (uv + parallax_intersection_numpy(relief, uv, shear) * shear * [1, -1]) * [32, 24]
        at = np.array([visible[view, texel] % 32, visible[view, texel] // 32]) + 0.5
        offset = (at - met + [16, 12]) % [32, 24] - [16, 12]
        assert np.abs(offset).max() < 0.51
    assert (visible_texels(np.zeros((1, 1), np.float32), rings, (3, 5)) == np.arange(15)).all()


def test_a_constant_height_gives_that_height():
    assert intersect_relief(np.full((3, 5), 0.25, np.float32), (0.3, 7.9), (3.0, -1.0)) == 0.25
    assert intersect_relief(np.zeros((1, 1), np.float32), (0.3, 0.9), (3.0, -1.0)) == 0


def test_shears_are_limited_by_the_last_ring():
    rings = ubo_grid()
    for w, slant in zip(directions(rings)[::9], compute_shears(rings)[::9], strict=True):
        np.testing.assert_allclose(compute_shear(rings, *w), slant, rtol=1e-5, atol=1e-6)
    assert np.hypot(*compute_shear(rings, 0.8, 0.59, 0.08)) == pytest.approx(np.tan(np.radians(75)), rel=1e-3)


def test_the_height_of_a_small_geometry_lies_between_its_lowest_and_its_highest():
    small = TileGeometry(weave(), ubo_grid(), (8, 8), 2, 1)
    height, z = small.height(), small._positions[:, 2]
    assert height.shape == (8, 8)
    assert z.min() <= height.min() < height.max() <= z.max()
    assert height.mean() > z.mean()  # the upper side is visible
