"""Tiles divided for an environment that they were not chosen for."""

from __future__ import annotations

import numpy as np
from tiny_scenes import studio

from relume.assets.environments.equirect import rotate_about_y
from relume.lights.light_moments import LightTexels
from relume.lights.spherical_triangles import EnvironmentTexels, integrate_environment
from relume.lights.tile_subdivision import choose_tiles, largest_metric, refine_tiles


def texels_in(tiles, environment, rotation):
    directions = rotate_about_y(environment.directions, rotation)
    return LightTexels(tiles.locate(directions), environment.luminous, directions, environment.solid_angles)


def test_tiles_are_divided_where_the_rotated_light_is():
    environment, tiles = EnvironmentTexels.from_radiance(studio()), choose_tiles(studio(), 400)
    texels = texels_in(tiles, environment, 77.0)
    metric = largest_metric(tiles, texels_in(tiles, environment, 0.0))
    assert largest_metric(tiles, texels) > 4 * metric
    refined, new = refine_tiles(tiles, texels, metric, 10_000)
    assert refined.is_whole()
    assert largest_metric(refined, texels_in(refined, environment, 77.0)) <= metric
    old = np.setdiff1d(np.arange(len(refined.codes)), new)
    np.testing.assert_array_equal(refined.codes[old], tiles.codes[old])
    assert not np.isin(refined.codes[new], tiles.codes).any()
    before, after = integrate_environment(tiles, environment, 77.0), integrate_environment(refined, environment, 77.0)
    np.testing.assert_allclose(after.irradiance.sum(axis=0), before.irradiance.sum(axis=0), rtol=1e-5)


def test_as_many_tiles_are_added_as_may_be_and_none_for_the_own_environment():
    environment, tiles = EnvironmentTexels.from_radiance(studio()), choose_tiles(studio(), 400)
    own = texels_in(tiles, environment, 0.0)
    same, new = refine_tiles(tiles, own, largest_metric(tiles, own), 200)
    np.testing.assert_array_equal(same.codes, tiles.codes)
    assert not len(new)
    more, _ = refine_tiles(tiles, texels_in(tiles, environment, 77.0), 0.0, 200)
    assert len(tiles.codes) + 200 - 3 < len(more.codes) <= len(tiles.codes) + 200
