"""Highlights between points: the sky in them is found for each pixel, and only the rest is interpolated."""

import numpy as np
import pytest
from tiny_scenes import looking, mesh, quad, scene_of, sphere, studio

from relume.bake import Recipe
from relume.environments.equirect import lookup, turned
from relume.look import complete, validate
from relume.memory import Memory
from relume.methods.registry import METHODS, open_bake
from relume.moving.basis import lobes as lobes_module
from relume.moving.basis.lobes import is_narrow, lobes_of
from relume.moving.basis.out_factors import NUM_ROWS
from relume.moving.between_points import SkyLight, take_off_lobes
from relume.moving.glints import LEAST_COSINE
from relume.moving.points.lattice import pieces_of, place_points
from relume.moving.points.sides import open_sides
from relume.moving.sky import sky_of, turn_of
from relume.render.image import render_image
from relume.scene.model import Material
from relume.store import bake_here
from relume.trace.geometry import merge

GLOSSY = {"model": "blinn_phong", "color": [0.9, 0.6, 0.3], "params": {"exponent": 30.0}}
NARROW = {"model": "blinn_phong", "color": [0.9, 0.6, 0.3], "params": {"exponent": 3000.0}}
CAMERA = looking("front", [0, 0.5, 3], [0, 0, 0], 0.75)


def ball(terms):
    material = Material("Ball", terms)
    return scene_of(
        sphere("ball", [0, 0, 0], 1, 0, 48), camera=CAMERA, environment=studio(64, 20.0), materials=[material]
    )


def opened(scene, method, folder, num_points=400):
    recipe = Recipe(method, ("front",), (64, 48), 2000, num_points=num_points)
    return open_bake(bake_here(METHODS[method], scene, recipe, folder / f"{method}.zarr"), Memory(1 << 30))


def picture_of(bake):
    return render_image(bake, "front", validate(complete({}, bake.default_look), bake.default_look))


@pytest.fixture(scope="module")
def shiny_ball(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ball")
    scene = ball((GLOSSY,))
    return opened(scene, "surface", folder), picture_of(opened(scene, "direct", folder))


def test_highlights_of_few_points_on_a_ball_are_those_of_a_fixed_view(shiny_ball, monkeypatch):
    """Some hundred points under a bright lamp; without their lobes they are patches."""
    moving, expected = shiny_ball

    def error():
        found = picture_of(moving)
        return np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))

    kept = error()
    monkeypatch.setattr(lobes_module, "_has_highlight", lambda term: False)
    assert kept < 0.08
    assert error() > 2.5 * kept


def lobe_numpy(surface, lobes, light, eye, share_of_sky, point):
    """L of a point, in plain NumPy: the oracle of what is taken off. (groups, 3)"""
    lobe = lobes.of[surface.material[point]]
    n = surface.points.normal[point].astype(np.float64)
    wo = eye - surface.points.position[point].astype(np.float64)
    wo /= np.linalg.norm(wo)
    place = np.sqrt(1 - np.clip(wo @ n, LEAST_COSINE, 1)) * (NUM_ROWS - 1)
    row = min(int(place), NUM_ROWS - 2)

    def at(table):
        return table[lobe, row] + (place - row) * (table[lobe, row + 1] - table[lobe, row])

    aside = (wo @ n) * n - wo
    direction = np.sqrt(1 - at(lobes.mean) ** 2) * aside / np.linalg.norm(aside) + at(lobes.mean) * n
    level = np.clip(np.log2(np.degrees(at(lobes.sigma)) / 2) + 1, 0, len(light.sky.levels) - 1)
    rotated = turned(direction[None], 360 * (0.5 - float(light.turn)))
    found = np.zeros(3)
    for k, share in ((int(level), 1 - level % 1), (int(np.ceil(level)), level % 1)):
        first, height, width = light.sky.levels[k]
        radiance = light.sky.texels[first : first + height * width].reshape(height, width, 3)
        found += share * lookup(radiance, rotated.astype(np.float32))[0]
    return at(lobes.albedo) * found * light.gain * share_of_sky


@pytest.mark.parametrize("rotation", [0.0, 123.0])
def test_what_is_taken_off_is_the_lobe_of_the_oracle(shiny_ball, rotation):
    moving, _ = shiny_ball
    surface, rng = moving.surface, np.random.default_rng(5)
    maps = {degrees: rng.random((16, 32, 3), np.float32) for degrees in (0.0, 2.0, 4.0, 8.0, 16.0, 32.0)}
    light = SkyLight(sky_of(maps.__getitem__), turn_of(rotation), np.array([1.0, 0.5, 2.0], np.float32))
    num, eye = surface.points.num_points, np.array([0.4, 1.5, 3.0], np.float32)
    glances = rng.random((num, 4), np.float32)
    lobes = lobes_of([[{**GLOSSY, "texture": "diffuse"}]])
    sent = np.zeros((num, 3, 3), np.float32)
    is_needed = (np.arange(num) % 3 > 0).astype(np.uint8)
    take_off_lobes(surface, lobes, light, eye, glances, is_needed, sent)
    assert not sent[is_needed == 0].any()
    for point in np.flatnonzero(is_needed)[::17]:
        expected = lobe_numpy(surface, lobes, light, eye.astype(np.float64), glances[point, 0], point)
        np.testing.assert_allclose(-sent[point], expected, rtol=2e-3, atol=1e-4)
    assert sent[:, 1].any()
    assert not sent[:, [0, 2]].any()


def test_what_the_in_basis_cannot_tell_is_a_lobe_alone(shiny_ball):
    surface = shiny_ball[0].surface
    assert is_narrow(NARROW)
    lobes = lobes_of([[NARROW, GLOSSY]])
    assert lobes.is_told.tolist() == [False]
    sent = np.zeros((surface.points.num_points, 3, 3), np.float32)
    light = SkyLight(sky_of(lambda degrees: np.ones((4, 8, 3), np.float32)), turn_of(0), np.ones(3, np.float32))
    everywhere = np.ones(len(sent), np.uint8)
    take_off_lobes(surface, lobes, light, CAMERA.to_world[:3, 3], np.ones((len(sent), 4), np.float32), everywhere, sent)
    assert not sent.any()


def test_a_surface_takes_from_its_own_points_and_not_from_what_lies_beside_it():
    """Two balls that almost touch, and a ground: points of the other have the same normals, and are as near."""
    balls = [sphere(f"ball {k}", [0.102 * k, 0.05, 0], 0.05, 0, 24) for k in range(2)]
    ground = quad("ground", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 1)
    materials = [Material(name, ({"model": "lambert", "color": [1, 1, 1]},)) for name in ("Balls", "Ground")]
    scene = scene_of(*balls, ground, camera=looking("front", [0, 1, 3], [0, 0, 0], 0.5), materials=materials)
    geometry, eyes = merge(scene), np.array([[0.0, 1.0, 3.0]])
    found = place_points(geometry, open_sides(geometry, scene.cameras, 1), eyes, 1500)
    vertices, points = found.vertices, found.points
    of_ball = found.material[vertices.point[:, 0]] == 0
    place = np.einsum("vk,vkc->vc", vertices.weight, points.position[vertices.point])
    for vertex in np.flatnonzero(of_ball):
        taken = points.position[vertices.point[vertex][vertices.weight[vertex] > 0], 0]
        assert len(np.unique(taken > 0.051)) == 1, place[vertex]


def test_faces_hang_together_by_places_of_corners():
    """Corners that differ in normals or textures alone are one place."""
    apart = [
        mesh("a", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], 0),
        mesh("b", [[1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2]], 0),
    ]
    far = mesh("c", [[5, 0, 0], [6, 0, 0], [5, 1, 0]], [[0, 1, 2]], 0)
    found = pieces_of(merge(scene_of(*apart, far, camera=CAMERA)))
    assert found[0] == found[1] != found[2]
