"""Linked lights of a free camera: as an unlinked light on linked surfaces, and none on others."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere

from relume.core.cache import Cache
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.openers import open_bake
from relume.look import complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

CAMERA = make_camera("front", [0.5, 2.2, 2.6], [0, 0.2, 0], 0.7)
SIZE = (64, 48)
LAMBERT = {"model": "lambert", "color": [0.8, 0.7, 0.6]}
GLOSSY = {"model": "blinn_phong", "color": [0.2, 0.2, 0.2], "params": {"exponent": 8.0}}
NARROW = {"model": "blinn_phong", "color": [0.2, 0.2, 0.2], "params": {"exponent": 3000.0}}
LIGHTS = {
    "point": {"kind": "point", "position": [0.8, 1.9, 0.4], "emission": [9.0, 8.0, 6.0]},
    "panel": {"kind": "rectangle", "position": [0.8, 1.9, 0.4], "direction": [-0.5, -1, 0], "emission": [9, 9, 9]},
    "directional": {"kind": "directional", "direction": [-0.5, -1.0, -0.25], "emission": [3.0, 2.8, 2.5]},
}
BALL = {"objects": ["ball"]}


@pytest.fixture(scope="module", params=[GLOSSY, NARROW], ids=["glossy", "narrow"])
def bake(request, tmp_path_factory):
    """A ball on a floor, under a sky with a sun, both of two terms."""
    radiance = np.full((64, 128, 3), 0.3, np.float32)
    radiance[10:12, 20:22] = 900
    floor = quad("floor", [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]], 0)
    ball = sphere("ball", [0.1, 0.4, 0], 0.4, 1, 16)
    materials = [Material(name, (LAMBERT, request.param)) for name in ("Floor", "Ball")]
    scene = make_tiny_scene(floor, ball, camera=CAMERA, environment=radiance, materials=materials)
    recipe = Recipe("probes", ("front",), SIZE, 200, num_probes=1500)
    store = bake_in_process(METHODS["probes"], scene, recipe, tmp_path_factory.mktemp("linked") / "probes.zarr")
    return open_bake(store, Cache(1 << 30))


def image(bake, lights=None, environment=None, show="direct"):
    document = copy.deepcopy(complete({}, bake.default_look))
    document["transport"]["show"] = show
    document["lights"] = lights or {}
    document["background"] = document["background"] | {"kind": "color", "color": [0.0, 0.0, 0.0]}
    document["environment"].update({"intensity": 0.0} if environment is None else environment)
    return render_image(bake, "front", validate(document, bake.default_look))


def shown(bake, mesh):
    """Pixels whose rays all hit one mesh."""
    picture = FreeCameraPicture(bake, "front")
    picture.set_look(validate(bake.default_look, bake.default_look))
    gbuffer, num_pixels = picture.gbuffer, SIZE[0] * SIZE[1]
    face = gbuffer.hits.face
    is_hit = (face >= 0) & (bake.light_transport.store.read("scene/face_mesh")[face] == mesh)
    pixel = np.concatenate([np.arange(num_pixels), gbuffer.owner])
    is_missed = np.bincount(pixel, ~is_hit, num_pixels) > 0
    return ~is_missed.reshape(SIZE[::-1])


@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS)
def test_linked_light_lights_exactly_the_included_object(bake, light):
    floor, ball = shown(bake, 0), shown(bake, 1)
    unlinked = image(bake, {"A": light})
    linked = image(bake, {"A": light | {"link": {"include": BALL}}})
    assert min(unlinked[floor].mean(), unlinked[ball].mean(), np.count_nonzero(ball) / 100) > 0.01
    np.testing.assert_allclose(linked[ball], unlinked[ball], rtol=1e-5, atol=1e-6)
    assert not linked[floor].any()


@pytest.mark.parametrize("show", ["direct", "all"])
@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS)
def test_included_and_excluded_light_add_to_the_unlinked_image(bake, light, show):
    parts = [image(bake, {"A": light | {"link": {mode: BALL}}}, show=show) for mode in ("include", "exclude")]
    unlinked = image(bake, {"A": light}, show=show)
    # negative light of the basis is clamped, which is not linear
    assert np.sqrt(np.mean((sum(parts) - unlinked) ** 2) / np.mean(unlinked**2)) < 1e-3


def test_linked_environment_lights_exactly_the_included_object(bake):
    floor, ball = shown(bake, 0), shown(bake, 1)
    unlinked, linked = image(bake, environment={}), image(bake, environment={"link": {"include": BALL}})
    np.testing.assert_allclose(linked[ball], unlinked[ball], rtol=1e-5, atol=1e-6)
    assert min(unlinked[floor].mean(), unlinked[ball].mean()) > 0.1
    assert not linked[floor].any()


def test_surface_that_casts_no_shadow_of_a_light(bake):
    """The floor below the ball is lit as if the ball were not there."""
    light = LIGHTS["directional"]
    shadowed, open_floor = (image(bake, {"A": light | {"shadow_link": link}}) for link in (None, {"exclude": BALL}))
    floor, ball = shown(bake, 0), shown(bake, 1)
    direction = np.array(light["direction"]) / np.linalg.norm(light["direction"])
    is_dark = floor & (shadowed.sum(axis=2) < 0.1 * np.median(shadowed[floor].sum(axis=1)))
    assert np.count_nonzero(is_dark) > 30
    diffuse = np.array(LAMBERT["color"]) / np.pi * np.array(light["emission"]) * -direction[1]
    assert (open_floor[is_dark] >= 0.98 * diffuse).all()
    assert (open_floor[is_dark] < 2 * diffuse + 0.1).all()
    assert (open_floor[ball] >= shadowed[ball] - 1e-5).all()
