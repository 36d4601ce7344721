"""The shadow of a sun in the environment follows it while it is turned: in previews, and exactly."""

from __future__ import annotations

import numpy as np
import pytest
from session_edits import BUDGET, kind_of, make_look, run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere

from relume.assets.environments.equirect import rotate_about_y, texel_directions
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.methods.registry import METHODS
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SUN, CENTER, RADIUS, SIZE = (20, 40), np.array([0, 0.7, 0]), 0.35, (96, 72)
WHITE = ({"model": "lambert", "color": [0.8] * 3},)


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    environment = np.full((64, 128, 3), 0.3, np.float32)
    environment[SUN] = 2000
    floor = quad("floor", [(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)], 0)
    ball = sphere("ball", CENTER, RADIUS, 1, num_rings=64)
    camera = make_camera("front", (0, 4, 3), (0, 0, 0), 0.8)
    materials = [Material("Floor", WHITE), Material("Ball", WHITE)]
    scene = make_tiny_scene(floor, ball, camera=camera, environment=environment, materials=materials)
    folder = tmp_path_factory.mktemp("sun")
    path = bake_in_process(METHODS["direct"], scene, Recipe("direct", ("front",), SIZE, 200), folder / "s.zarr")
    return open_transfer(path, Cache(1 << 30))


def wrong_part(bake, picture, degrees):
    """Fraction of the floor that is lit by the sun in the picture but not by the ball's shadow, or the reverse."""
    view = bake.views["front"]
    position = view.receivers(0).points.position.astype(float)
    sun = rotate_about_y(texel_directions(64, 128)[SUN][None].astype(float), degrees)[0]
    to_center = CENTER - position
    along = to_center @ sun
    is_lit = ((to_center**2).sum(axis=1) - along**2 > RADIUS**2) | (along < 0)
    radiance = picture._images.by_name["Floor"].terms[0].displayed.image.transpose(0, 2, 1).reshape(-1, 3)
    value = radiance[: len(position), 1]
    assert 0.02 < 1 - is_lit.mean() < 0.3
    return np.mean((value > (value.max() + value.min()) / 2) != is_lit)


@pytest.mark.parametrize("degrees", [101.0, 236.0])
def test_the_shadow_is_where_the_sun_casts_it(bake, degrees):
    def turned(document):
        document["environment"]["rotation"] = degrees

    picture = run_until_exact(Picture(bake, "front", Cache(BUDGET)))
    picture.set_look(make_look(bake, turned))
    assert kind_of(picture.next_job()) == "preview"
    picture.run_next_job(lambda fraction: None, lambda: False)
    picture.advance(None)
    preview = wrong_part(bake, picture, degrees)
    exact = wrong_part(bake, run_until_exact(picture), degrees)
    assert max(preview, exact) < 0.002  # 0.007 to 0.012 with the shadow rays of the bake
