"""Occluded nodes: pixels take no light from behind walls, and none from under objects."""

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, mesh, quad

from relume.assets.environments.equirect import texel_directions
from relume.core.cache import Cache
from relume.live.free_camera import free_camera_picture as picture_module
from relume.live.free_camera.occluded_probes import reweight
from relume.live.free_camera.primary_visibility import trace_primary
from relume.live.opened.openers import open_bake
from relume.look import complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = (64, 48)
CAMERA = make_camera("front", [0.9, 1.4, 2.4], [0, 0.1, 0], 0.6)
BOX = [[x, y, z] for x in (-0.33, 0.33) for y in (0, 0.6) for z in (-0.33, 0.33)]


def scene():
    """A box without a bottom on a floor, in a uniform environment."""
    floor = quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    sides = ([1, 5, 7, 3], [5, 4, 6, 7], [4, 0, 2, 6], [0, 1, 3, 2], [3, 7, 6, 2])
    box = [quad(f"side {k}", [BOX[i] for i in side], 1) for k, side in enumerate(sides)]
    radiance = np.where(texel_directions(16, 32)[..., 1:2] > 0, 1.0, 0.0) * np.ones(3)
    materials = [Material(name, ({"model": "lambert", "color": [0.7, 0.7, 0.7]},)) for name in ("Floor", "Box")]
    environment_radiance = radiance.astype(np.float32)
    return make_tiny_scene(floor, *box, camera=CAMERA, environment=environment_radiance, materials=materials)


@pytest.fixture(scope="module")
def free_bake(tmp_path_factory):
    recipe = Recipe("probes", ("front",), SIZE, 100, num_probes=500)
    return open_bake(
        bake_in_process(METHODS["probes"], scene(), recipe, tmp_path_factory.mktemp("occluded") / "s.zarr"),
        Cache(1 << 30),
    )


def is_inside(position):
    """True for positions on the floor under the box."""
    return (np.abs(position[:, [0, 2]]) < 0.33).all(axis=1)


def test_pixels_next_to_a_box_ignore_nodes_under_it(free_bake):
    """Nodes under the box have no weight in pixels of the floor, unless all three lie there."""
    gbuffer = trace_primary(free_bake.stored_scene, free_bake.embree, CAMERA, SIZE)
    before = gbuffer.weight.copy()
    reweight(gbuffer, free_bake.has_occluded_neighbor, free_bake.occlusion_mesh)
    surface = free_bake.stored_scene
    position = surface.probes.position[surface.lattice_nodes.probe[:, 0]]
    on_floor = (gbuffer.hits.face >= 0) & (surface.face_material[gbuffer.hits.face] == 0)
    under = np.stack([is_inside(position[gbuffer.lattice_node[:, k]]) for k in range(3)], axis=1)
    is_mixed = on_floor & under.any(axis=1) & ~under.all(axis=1)
    assert is_mixed.sum() > 10
    assert (before[is_mixed][under[is_mixed]] > 0.1).any()
    assert (gbuffer.weight[is_mixed][under[is_mixed]] == 0).all()
    np.testing.assert_allclose(gbuffer.weight[on_floor].sum(axis=1), 1, atol=1e-5)
    is_far = on_floor & ~(free_bake.has_occluded_neighbor[gbuffer.lattice_node] > 0).any(axis=1)
    np.testing.assert_array_equal(gbuffer.weight[is_far], before[is_far])
    changed = (gbuffer.weight != before).any(axis=1)
    assert 0 < changed.mean() < 0.1


def test_the_contact_line_equals_a_fixed_view(free_bake, monkeypatch, tmp_path):
    recipe = Recipe("gather", ("front",), SIZE, 100)
    fixed = open_bake(bake_in_process(METHODS["gather"], scene(), recipe, tmp_path / "g.zarr"), Cache(1 << 30))
    plain = validate(complete({}, free_bake.default_look), free_bake.default_look)
    expected = render_image(fixed, "front", plain)

    def error():
        actual = render_image(free_bake, "front", plain)
        return np.sqrt(np.mean((actual - expected) ** 2) / np.mean(expected**2))

    corrected = error()
    monkeypatch.setattr(picture_module, "reweight", lambda *args: None)
    assert corrected < 0.8 * error()


def test_adjacent_faces_do_not_occlude_each_other(tmp_path):
    """The corner of a room: nodes on an edge lie in both walls, and are visible from both."""
    corners = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [0, 0, 2], [0, 2, 2]]
    walls = mesh("walls", corners, [[0, 1, 2], [0, 2, 3], [4, 0, 3], [4, 3, 5]], 0)
    floor = quad("floor", [[0, 0, 2], [2, 0, 2], [2, 0, 0], [0, 0, 0]], 0)
    meeting_walls = make_tiny_scene(walls, floor, camera=make_camera("front", [3, 2, 4], [0, 0.5, 0], 0.6))
    recipe = Recipe("probes", ("front",), SIZE, 60, num_probes=800)
    bake = open_bake(bake_in_process(METHODS["probes"], meeting_walls, recipe, tmp_path / "s.zarr"), Cache(1 << 30))
    assert not bake.has_occluded_neighbor.any()
