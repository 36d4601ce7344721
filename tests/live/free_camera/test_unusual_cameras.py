"""Free cameras where nobody puts one: in walls, in glass, in closed rooms, in a plane, at any field of view.

All scenes have Lambert surfaces of albedo 0.5 under uniform light of radiance 1.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from shared_bakes import unmeasured
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere

from relume.core.cache import Cache
from relume.live.opened.openers import open_bake
from relume.look import validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.probes.density import density_from_distance
from relume.probes.mesh_lattice import make_corner_grid, place_probes
from relume.probes.visible_sides import visible_sides
from relume.raytrace.camera_rays import camera_directions
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.scene.model import Glass, Light, Material
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

__all__ = ["unmeasured"]  # a fixture

SIZE = 32, 24
PAPER = Material("Paper", ({"model": "lambert", "color": [0.5] * 3},))
UNIFORM = np.ones((8, 16, 3), np.float32)
FRONT = make_camera("front", (0, 1.5, 4), (0, 0.3, 0), 0.8)
TOLERANCE = 0.03  # of 100 environment triangles


def floor():
    return quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)


def box(name, low, high, *, is_inward=False):
    """Six quads; fronts face outward, or inward."""
    (a, b, c), (d, e, f) = low, high
    sides = [
        [[a, b, f], [d, b, f], [d, e, f], [a, e, f]], [[d, b, c], [a, b, c], [a, e, c], [d, e, c]],
        [[a, b, c], [a, b, f], [a, e, f], [a, e, c]], [[d, b, f], [d, b, c], [d, e, c], [d, e, f]],
        [[a, e, f], [d, e, f], [d, e, c], [a, e, c]], [[a, b, c], [d, b, c], [d, b, f], [a, b, f]],
    ]  # fmt: skip
    return [
        quad(f"{name} {k}", side[::-1] if is_inward else side, 0, tangent=(0, 1, 0) if k in (2, 3) else (1, 0, 0))
        for k, side in enumerate(sides)
    ]


def bake(scene, folder):
    recipe = Recipe("probes", (scene.cameras[0].name,), SIZE, 100, num_probes=300)
    return open_bake(bake_in_process(METHODS["probes"], scene, recipe, folder / "store.zarr"), Cache(1 << 28))


def picture(opened, camera, **look):
    return render_image(opened, "front", validate(look, opened.default_look), camera_and_size=(camera, SIZE))


def looking(origin, right, up, back):
    """A camera with these axes."""
    to_world = np.eye(4)
    to_world[:3] = np.column_stack([right, up, back, origin])
    return replace(FRONT, to_world=to_world)


@pytest.fixture(scope="module")
def plane(tmp_path_factory, unmeasured):
    """A scene of one plane."""
    scene = make_tiny_scene(floor(), camera=FRONT, environment=UNIFORM, materials=[PAPER])
    return bake(scene, tmp_path_factory.mktemp("plane"))


def floor_corners(camera):
    """Number of corners of each pixel that show the floor, from 0 to 4."""
    y, x = np.indices(SIZE[::-1]).reshape(2, -1).astype(np.float32)
    origin, count = camera.to_world[:3, 3], np.zeros(len(x), int)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        rays = camera_directions(camera, SIZE, x + dx, y + dy).astype(np.float64)
        distance = -origin[1] / np.where(rays[:, 1] == 0, 1e-30, rays[:, 1])
        hits = origin + distance[:, None] * rays
        count += (distance > 0) & (np.abs(hits[:, [0, 2]]) <= 2).all(axis=1)
    return count


@pytest.mark.parametrize("degrees", [1, 5, 60, 120, 170, 179])
def test_the_field_of_view_has_its_whole_range(plane, degrees):
    camera = replace(make_camera("free", (0, 1, 3), (0, 0, 0), 1.0), yfov=math.radians(degrees))
    image, count = picture(plane, camera).reshape(-1, 3), floor_corners(camera)
    assert (count.min() == 4) == (degrees <= 5)
    assert (count.max() < 4) == (degrees >= 170)
    np.testing.assert_allclose(image[count == 4], 0.5, rtol=TOLERANCE)
    outside = image[count == 0]
    assert np.isfinite(image).all()
    assert (np.abs(outside - 1) > 1e-5).any(axis=1).sum() <= 2  # the floor may be smaller than a pixel


def test_a_plane_has_two_sides_and_no_thickness(plane):
    down = looking((0.3, 1e-6, 0.2), (1, 0, 0), (0, 0, -1), (0, 1, 0))
    below = looking((0.3, -1e-6, 0.2), (1, 0, 0), (0, 0, 1), (0, -1, 0))
    for camera in (down, below):
        np.testing.assert_allclose(picture(plane, camera), 0.5, rtol=TOLERANCE)
    for origin in ((0, 0, 4), (0, 0, 1)):  # edge on
        np.testing.assert_allclose(picture(plane, looking(origin, (1, 0, 0), (0, 1, 0), (0, 0, 1))), 1, rtol=1e-5)


def test_a_wall_has_the_light_of_its_outer_side_within(tmp_path):
    """The outer side of a lone box receives half of the uniform light on a plane, and all of it above the plane."""
    scene = make_tiny_scene(
        *box("wall", (-1, -1, -0.1), (1, 1, 0.1)), camera=FRONT, environment=UNIFORM, materials=[PAPER]
    )
    opened = bake(scene, tmp_path)
    for origin in ((0.2, 0.1, 0), (0.2, 0.1, 0.0999)):
        image = picture(opened, make_camera("free", origin, (1, 0.2, 0.05), 1.0))
        np.testing.assert_allclose(image, 0.5, rtol=TOLERANCE)


def test_clear_glass_is_clear_from_within(tmp_path):
    """From the middle of a ball all light comes along normals: 0.96 is transmitted, at most 0.04 reflected."""
    clear = Material(
        "Glass",
        ({"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.05, "f0": 0.04}},),
        glass=Glass(thickness=1.0),
    )
    ball = sphere("ball", [0, 0, 0], 0.5, 0, 24)
    opened = bake(make_tiny_scene(ball, camera=FRONT, environment=UNIFORM, materials=[clear]), tmp_path)
    image = picture(opened, make_camera("free", (0, 0, 0), (1, 0.4, -0.5), 1.0))
    np.testing.assert_allclose(image, 0.98, atol=0.021)


def test_a_room_without_a_door_is_dark(tmp_path):
    """Its walls are thick, and it is not symmetric: light along a diagonal of two corners would pass both edges."""
    scene = make_tiny_scene(
        *box("inside", (-1, 0, -1), (1, 2, 1.1), is_inward=True), *box("outside", (-1.3, -0.2, -1.4), (1.2, 2.3, 1.3)),
        camera=make_camera("front", (0.5, 1, 0.8), (-0.5, 0.5, -1), 1.0), environment=UNIFORM, materials=[PAPER],
    )  # fmt: skip
    opened = bake(scene, tmp_path)
    assert picture(opened, scene.cameras[0]).max() < 1e-3
    image = picture(opened, make_camera("free", (0, 1, 5), (0, 1, 0), 0.3))
    np.testing.assert_allclose(image, 0.5, rtol=TOLERANCE)


@pytest.mark.parametrize("thickness", [1e-2, 1e-5])
def test_no_direct_light_passes_a_thin_wall(thickness, tmp_path):
    half = thickness / 2
    left = quad("left", [[-half, 0, -1], [-half, 0, 1], [-half, 2, 1], [-half, 2, -1]], 0, tangent=(0, 1, 0))
    right = quad("right", [[half, 0, 1], [half, 0, -1], [half, 2, -1], [half, 2, 1]], 0, tangent=(0, 1, 0))
    lit = make_camera("front", (-1.8, 1, 0.8), (0, 0.8, -0.5), 1.0)
    made = make_tiny_scene(
        *box("room", (-2, 0, -1), (2, 2, 1), is_inward=True),
        left,
        right,
        camera=lit,
        environment=UNIFORM,
        materials=[PAPER],
    )
    bulb = Light("Bulb", {"kind": "point", "position": [-1.0, 1.5, 0.0], "emission": [1.0] * 3})
    opened = bake(
        make_scene("thin", made.meshes, made.materials, made.cameras, made.environment, lights=[bulb]), tmp_path
    )
    wall = make_camera("free", (1.8, 1, 0), (0, 1, 0), 0.6)  # the middle of the dark side
    dark, bright = (picture(opened, camera, transport={"show": "direct"}) for camera in (wall, lit))
    assert bright.mean() > 0.02
    assert dark.max() < 1e-4


def test_each_of_a_thousand_rooms_has_probes():
    quads = [
        side
        for i in range(40)
        for j in range(25)
        for side in box(f"{i} {j}", (i, 0, j), (i + 0.95, 1, j + 0.95), is_inward=True)[:4]  # without floor and ceiling
    ]
    corners = np.concatenate([each.positions for each in quads])
    fields = {name: np.concatenate([getattr(q, name) for q in quads]) for name in ("normals", "tangents", "uvs")}
    faces = np.concatenate([each.faces + 4 * k for k, each in enumerate(quads)]).astype(np.uint32)
    mesh = replace(quads[0], positions=corners, faces=faces, **fields)
    camera = make_camera("front", (20.8, 0.8, 12.8), (20.2, 0.3, 12), 1.0)
    geometry = build_scene_buffers(make_tiny_scene(mesh, camera=camera, environment=UNIFORM, materials=[PAPER]))
    is_open = visible_sides(geometry, [camera], 0)
    density = density_from_distance(geometry, camera.to_world[None, :3, 3], make_corner_grid(is_open))
    placed = place_probes(geometry, is_open, density, 40_000)
    assert 0.95 * 40_000 < placed.probes.num_points < 1.05 * 40_000
    rooms = np.floor(placed.probes.position[:, [0, 2]] + 0.02).astype(int)
    assert len(np.unique(rooms, axis=0)) >= 1000
