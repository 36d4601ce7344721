"""Highlights have their shape while the environment turns, though previews keep the visibility of the baked tiles."""

from __future__ import annotations

import numpy as np
import pytest
from session_edits import BUDGET, kind_of, make_look, relative_rmse, run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, sphere

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.opened.openers import open_transfer
from relume.live.opened.refined_environments import LightsOfHighlights, RefinedEnvironments
from relume.look import EnvironmentKey
from relume.methods.registry import METHODS
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

GLOSSY = ({"model": "cook_torrance", "color": [1] * 3, "params": {"sigma": 0.075, "ior": 1.5}},)
TURNED = 160.0


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    """A ball under two strips of light, which light it from the side of the camera when they are turned."""
    environment = np.full((64, 128, 3), 0.1, np.float32)
    environment[18:28, 24:27] = environment[18:28, 31:34] = 60
    camera = make_camera("front", (0, 1, 4), (0, 0, 0), 0.5)
    scene = make_tiny_scene(
        sphere("ball", np.zeros(3), 0.8, 0, num_rings=64),
        camera=camera,
        environment=environment,
        materials=[Material("Ball", GLOSSY)],
    )
    folder = tmp_path_factory.mktemp("strips")
    path = bake_in_process(METHODS["direct"], scene, Recipe("direct", ("front",), (64, 64), 300), folder / "s.zarr")
    return open_transfer(path, Cache(1 << 30))


def preview_error(bake, degrees, terms=GLOSSY):
    """Error of the preview of a turned environment; each angle once, since exact pictures are kept."""

    def turned(document):
        document["environment"]["rotation"] = degrees
        document["materials"]["Ball"] = {"terms": list(terms)}

    picture = Picture(bake, "front", Cache(BUDGET))
    picture.set_look(make_look(bake, lambda document: document["materials"].update(Ball={"terms": list(terms)})))
    run_until_exact(picture)
    picture.set_look(make_look(bake, turned))
    picture.advance(None)
    assert kind_of(picture.next_job()) == "preview"
    picture.run_next_job(lambda fraction: None, lambda: False)
    picture.advance(None)
    preview = picture.image()
    exact = run_until_exact(picture).image()
    assert exact.max() > 0.5
    return relative_rmse(preview, exact)


def test_highlights_of_previews_follow_the_light_into_wide_tiles(bake, monkeypatch):
    refined = preview_error(bake, TURNED)

    def in_baked_tiles(environments, environment):
        lights = environments._bake.environment_lights(environment, LightQuality.PREVIEW)
        return LightsOfHighlights(lights, np.arange(lights.num_lights))

    monkeypatch.setattr(RefinedEnvironments, "of_highlights", in_baked_tiles)
    baked = preview_error(bake, TURNED + 1)
    assert refined < 0.05
    assert refined < 0.5 * baked


def test_lights_of_highlights_have_the_visibility_of_the_tile_that_they_are_in(bake):
    lights, baked = bake.refined.of_highlights(EnvironmentKey(None, TURNED))
    codes, tiles = lights.codes.astype(object), bake.tiles.codes.astype(object)
    assert lights.num_lights > len(tiles)
    for code, tile in zip(codes, tiles[baked], strict=True):
        assert int(code) >> (int(code).bit_length() - int(tile).bit_length()) == int(tile)
    own, same = bake.refined.of_highlights(EnvironmentKey(None, 0.0))
    assert own is bake.lights
    np.testing.assert_array_equal(same, np.arange(own.num_lights))


def test_the_brightest_lights_are_a_part_of_all(bake):
    samples, light = (
        bake.samples(bake.views["front"], 0, Cache(BUDGET)),
        Picture(bake, "front", Cache(BUDGET))._images.light,
    )
    turned_light = light._replace(environment=EnvironmentKey(None, TURNED))
    all_lights, _ = bake.preview_highlights(samples, turned_light)
    brightest, points = bake.preview_highlights(samples, turned_light, max_lights=20)
    power = np.sort(all_lights.irradiance.sum(axis=1))[::-1]
    np.testing.assert_allclose(np.sort(brightest.irradiance.sum(axis=1))[::-1], power[:20])
    assert points.visible.shape[1] == 3


POLISHED = ({"model": "ggx", "color": [1] * 3, "params": {"roughness": 0.1, "f0": [0.9] * 3}},)


def test_polished_surfaces_are_not_interpolated(bake, monkeypatch):
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._NUM_SHADED", 100)
    traced = preview_error(bake, 200.0, POLISHED)
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview.has_round_narrow_lobe", lambda live: False)
    interpolated = preview_error(bake, 201.0, POLISHED)
    assert traced < 0.15
    assert traced < 0.6 * interpolated
