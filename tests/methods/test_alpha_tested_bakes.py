"""Bakes of alpha-tested surfaces: opened bakes and pictures see through them like the bake."""

from __future__ import annotations

import numpy as np
import pytest
from session_edits import make_look, relative_rmse
from shared_bakes import unmeasured
from tiny_scenes import make_camera, make_surface_points, make_tiny_scene, quad, studio

from relume.core.cache import Cache
from relume.lights.local_lights import make_light_strata, prepare_local_lights
from relume.live.free_camera.browser.geometry_arrays import constants
from relume.live.opened.openers import open_bake
from relume.look import LightGeometry
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.raytrace.local_light_visibility import trace_light_visibility
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.reference.image import reference_image
from relume.scene.model import Material, Opacity
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

__all__ = ["unmeasured"]  # a fixture

POINT_LIGHT = LightGeometry("point", (0.2, 1.8, 0.5))


def bars():
    """Opacity of eight vertical bars, as wide as their gaps."""
    return np.tile(np.repeat(np.uint8([0, 255]), 4), (4, 8))


@pytest.fixture(scope="module")
def scene():
    """A floor under a card of bars."""
    floor = quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    card = quad("card", [[-1, 0.8, 1], [1, 0.8, 1], [1, 0.8, -1], [-1, 0.8, -1]], 1)
    materials = [
        Material("Floor", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},)),
        Material("Card", ({"model": "lambert", "color": [0.2, 0.6, 0.2]},), opacity=Opacity(bars(), cutoff=0.5)),
    ]
    camera = make_camera("front", (0.5, 2.2, 3), (0, 0.2, 0), 0.8)
    return make_tiny_scene(floor, card, camera=camera, environment=studio(), materials=materials)


def opened(scene, method, folder):
    recipe = Recipe(method, ("front",), (48, 36), 500, num_probes=2000)
    return open_bake(bake_in_process(METHODS[method], scene, recipe, folder / f"{method}.zarr"), Cache(1 << 30))


@pytest.fixture(scope="module")
def direct(scene, tmp_path_factory):
    return opened(scene, "direct", tmp_path_factory.mktemp("direct"))


def test_local_lights_of_an_opened_bake_pass_through_holes(scene, direct):
    x, z = np.random.default_rng(1).uniform(-1, 1, (2, 2000))
    points = make_surface_points(np.stack([x, np.full_like(x, 1e-3), z], axis=1), np.tile([0, 1, 0], (2000, 1)))
    geometry = build_scene_buffers(scene)
    prepared = prepare_local_lights(POINT_LIGHT)
    expected = trace_light_visibility(geometry.embree, prepared, make_light_strata(prepared, 64), points)
    visible = direct.local.shadows(POINT_LIGHT, points).visible
    np.testing.assert_array_equal(visible, expected)
    assert 0.3 < (visible & 1).mean() < 0.9


@pytest.mark.parametrize("method", ["direct", "gather"])
def test_pictures_of_alpha_tested_surfaces_equal_the_reference(scene, method, tmp_path):
    bake = opened(scene, method, tmp_path)
    look = make_look(bake)
    expected = reference_image(
        scene, "front", look, (48, 36), 0 if method == "direct" else 1024, reflects=method == "gather"
    )
    picture = render_image(bake, "front", look)
    assert relative_rmse(picture, expected) < 0.03
    whole = [Material(material.name, material.terms) for material in scene.materials]
    without = make_tiny_scene(*scene.meshes, camera=scene.cameras[0], environment=studio(), materials=whole)
    assert relative_rmse(picture, reference_image(without, "front", look, (48, 36), 0)) > 0.15


def test_a_free_camera_and_the_browser_use_alpha_testing(scene, tmp_path):
    bake = opened(scene, "probes", tmp_path)
    holes = bake.embree.alpha_test
    assert holes is not None
    np.testing.assert_array_equal(holes.image >= 0, bake.stored_scene.face_material == 1)
    assert constants(bake)["has_alpha_test"]
    look = make_look(bake)
    expected = reference_image(scene, "front", look, (48, 36), 0)
    assert relative_rmse(render_image(bake, "front", look), expected) < 0.2


def test_bakes_of_opaque_surfaces_store_no_opacity(scene, tmp_path):
    whole = [Material(material.name, material.terms) for material in scene.materials]
    without = make_tiny_scene(*scene.meshes, camera=scene.cameras[0], environment=studio(), materials=whole)
    bake = opened(without, "probes", tmp_path)
    assert bake.embree.alpha_test is None
    assert not constants(bake)["has_alpha_test"]
    assert not (tmp_path / "probes.zarr" / "alpha_masks").exists()
