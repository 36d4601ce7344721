"""Where points lie: more where eyes begin, and where shadows end."""

import numpy as np
import pytest
from sessions import relative_rmse
from tiny_scenes import looking, mesh, quad, scene_of, studio

from relume.bake import Recipe
from relume.light.triangles import subdivide
from relume.look import validate
from relume.memory import Memory
from relume.methods.registry import METHODS, open_bake
from relume.moving.points.density import by_distance, by_shadows
from relume.moving.points.lattice import place_points
from relume.moving.points.sides import open_sides
from relume.render.image import render_image
from relume.scene.model import Material
from relume.store import bake_here
from relume.trace.geometry import merge

EYE = np.array([[0.0, 3.0, 4.0]])
STEPS = 16  # of the floor, along each side


@pytest.fixture(scope="module")
def scene():
    """A floor of many faces, and a card that stands on its middle."""
    z, x = np.meshgrid(*[np.linspace(-4, 4, STEPS + 1)] * 2, indexing="ij")
    at = np.arange((STEPS + 1) ** 2).reshape(STEPS + 1, -1)
    corners = [part.ravel() for part in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:])]
    faces = np.concatenate([np.stack([corners[0], *two], axis=1) for two in (corners[1:3], corners[2:4])])
    positions = np.stack([x.ravel(), 0 * x.ravel(), z.ravel()], axis=1)
    floor = mesh("floor", positions, faces, 0, normals=np.tile([0.0, 1, 0], (len(positions), 1)))
    card = quad("card", [[-0.3, 0, 0.1], [0.3, 0, 0.1], [0.3, 0.5, 0.1], [-0.3, 0.5, 0.1]], 1)
    grey = [Material(name, ({"model": "lambert", "color": [0.8, 0.8, 0.8]},)) for name in ("Floor", "Card")]
    camera = looking("front", EYE[0], [0, 0, 0], 0.5)
    return scene_of(floor, card, camera=camera, environment=studio(32, 20.0), materials=grey)


def shadowed(scene):
    geometry = merge(scene)
    coarse = by_distance(geometry, EYE)
    placed = place_points(geometry, open_sides(geometry, scene.cameras, 1), coarse, 1500)
    return geometry, coarse, by_shadows(geometry, placed, coarse, subdivide(scene.environment.radiance, 32))


def test_far_from_the_eye_points_are_farther_apart(scene):
    geometry = merge(scene)
    eye = np.array([0.0, 0.5, 2.0])
    distance = np.linalg.norm(geometry.positions[geometry.faces].mean(axis=1) - eye, axis=1)
    coarse = by_distance(geometry, eye[None])
    assert coarse[distance.argmax()] == 8 * coarse[distance.argmin()]
    assert set(np.log2(coarse)) <= set(range(-2, 3))


def test_they_are_dense_where_shadows_end(scene):
    geometry, before, after = shadowed(scene)
    centre = geometry.positions[geometry.faces].mean(axis=1)
    is_floor, far = geometry.face_material == 0, np.linalg.norm(centre, axis=1)
    ratio = after / before
    assert np.median(ratio[is_floor & (far < 0.8)]) <= 0.5 * np.median(ratio[is_floor & (far > 3)])
    np.testing.assert_array_equal(np.rint(np.log2(ratio)), np.log2(ratio))


def test_shadows_are_nearer_to_the_truth_so(scene, tmp_path, monkeypatch):
    def shown(method, name):
        recipe = Recipe(method, ("front",), (64, 48), 300, num_points=1500)
        bake = open_bake(bake_here(METHODS[method], scene, recipe, tmp_path / f"{name}.zarr"), Memory(1 << 30))
        look = validate({"transport": {"bounces": 0}} if method == "surface" else {}, bake.default_look)
        return render_image(bake, "front", look)[..., :3]

    truth, now = shown("direct", "truth"), shown("surface", "now")
    monkeypatch.setattr("relume.methods.surface.by_shadows", lambda geometry, placed, coarse, lights: coarse)
    assert relative_rmse(now, truth) < 0.8 * relative_rmse(shown("surface", "before"), truth)


def test_where_nothing_is_in_the_way_distance_counts_alone():
    ground = quad("ground", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    scene = scene_of(ground, camera=looking("front", EYE[0], [0, 0, 0], 0.8), environment=studio(32, 20.0))
    _, before, after = shadowed(scene)
    np.testing.assert_array_equal(before, after)
