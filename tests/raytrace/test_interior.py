"""Rooms: the first surface on a path, what encloses a point, and cameras inside rooms."""

import numpy as np
import pytest
from tiny_scenes import quad, sphere

from relume.raytrace.embree import EmbreeScene
from relume.raytrace.interior import find_surroundings, first_obstacle, interior_camera, sees_only_outside
from relume.raytrace.ray_origins import OriginMesh
from relume.raytrace.scene_buffers import merge_meshes
from relume.scene.examples.catalog import built_in
from relume.scene.model import Camera

LOW, HIGH = np.array([-3.0, 0, -2]), np.array([3.0, 2.8, 2])


def box(low, high, *, inward=False):
    """The six sides of a box, facing outward or inward."""
    low, high, sides = np.asarray(low, float), np.asarray(high, float), []
    for axis in range(3):
        for is_high in (False, True):
            u, v, corners = (axis + 1) % 3, (axis + 2) % 3, []
            for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                corner = low.copy()
                corner[axis], corner[u], corner[v] = (
                    (high if is_high else low)[axis],
                    (low, high)[a][u],
                    (low, high)[b][v],
                )
                corners.append(corner)
            sides.append(quad(f"{axis}{is_high}", corners if is_high != inward else corners[::-1], 0))
    return sides


def traced(*meshes):
    """The acceleration structure of meshes, and their face normals."""
    buffers = merge_meshes(meshes)
    corners = buffers.positions[buffers.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return EmbreeScene.build(buffers.positions, buffers.faces), normals.astype(np.float32)


def obstacle(path, *meshes):
    """The first of the meshes on a path."""
    buffers, (embree, normals) = merge_meshes(meshes), traced(*meshes)
    return first_obstacle(embree, OriginMesh.build(buffers.positions, buffers.faces, normals), path)


ROOM = *box(LOW, HIGH, inward=True), *box(LOW - 0.3, HIGH + 0.3)  # closed, with walls 0.3 m thick and no door


@pytest.fixture(scope="module")
def room():
    return traced(*ROOM)


def path(*points):
    return np.array(points, np.float64)


def test_the_first_surface_stops_a_path_at_its_length(room):
    _, normals = room
    wall = obstacle(path((0, 1, 0), (2, 1, 0), (2, 1, 1), (4, 1, 1)), *ROOM)
    assert wall.length == pytest.approx(2 + 1 + 1, abs=1e-5)
    np.testing.assert_allclose(normals[wall.face], [-1, 0, 0], atol=1e-6)
    assert obstacle(path((0, 1, 0), (2, 1, 0), (2, 1, 1)), *ROOM) is None
    assert obstacle(path((0, 1, 0), (0, 1, 0)), *ROOM) is None


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
def test_a_camera_on_a_surface_leaves_it_to_both_sides_and_a_thin_wall_stops_it(size):
    corners = size * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    wall = quad("wall", corners, 0)
    for z in (size, -size):
        assert obstacle(path((0, 0, 0), (0, 0, z)), wall) is None
    for thickness in (0, 1e-7, 1e-5, 1e-3):
        back = quad("back", corners - [0, 0, thickness * size], 0)
        for z in (size, -size):
            surface = obstacle(path((0.1 * size, 0.2 * size, z), (0.1 * size, 0.2 * size, -z)), wall, back)
            assert surface.length == pytest.approx(size, rel=2e-3)


def test_a_camera_on_a_tilted_surface_far_from_the_origin_leaves_it_and_meets_the_next():
    """Positions there are 0.03 m apart."""
    at = np.array([4e5, 2e5, -3e5])
    corners = np.array([[-5, 1, -5], [5, 2, -5], [5, 3, 5], [-5, 2, 5]], float)  # a parallelogram
    floor, ceiling = (quad("plane", at + corners + [0, y, 0], 0) for y in (0, 4))
    start = floor.positions.astype(float).mean(axis=0)
    surface = obstacle(np.stack([start, start + np.array([0, 9, 0])]), floor, ceiling)
    assert surface.length == pytest.approx(4, abs=0.1)


def test_points_are_in_rooms_in_solids_or_in_the_open(room):
    inside, wall, outside = find_surroundings(*room, path((0, 1, 0), (3.15, 1, 0), (9, 1, 0)))
    assert inside.is_room
    assert not inside.is_solid
    assert inside.nearest == pytest.approx(1, abs=0.2)
    assert wall.is_solid
    assert not wall.is_room
    assert not outside.is_room
    assert not outside.is_solid
    ceiling = quad("ceiling", [[0, 99, 0], [1, 99, 0], [1, 99, 1], [0, 99, 1]], 0)
    (nothing,) = find_surroundings(*traced(ceiling), path((0, 0, 0)))
    assert nothing.nearest > 50


def test_a_camera_is_put_into_a_closed_room(room):
    bounds = LOW - 0.3, HIGH + 0.3
    camera = interior_camera(*room, bounds, "inside")
    position, forward = camera.to_world[:3, 3], -camera.to_world[:3, 2]
    assert (position > LOW).all()
    assert (position < HIGH).all()
    assert position[1] == pytest.approx(1.4, abs=1e-3)  # half of a room of less than 3.2 m
    assert obstacle(np.array([position, position + 3 * forward]), *ROOM) is None
    np.testing.assert_allclose(camera.to_world[:3, :3].T @ camera.to_world[:3, :3], np.eye(3), atol=1e-12)
    outside = Camera("front", np.eye(4), 0.7)
    outside.to_world[:3, 3] = 0, 1, 9
    assert sees_only_outside(*room, outside, camera)
    assert not sees_only_outside(*room, camera, camera)


def test_scenes_without_a_room_have_no_interior():
    plane = quad("plane", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    ball = sphere("ball", [0, 0, 0], 1, 0)
    for meshes, low, high in (([plane], [-1, 0, -1], [1, 0, 1]), ([ball], [-1] * 3, [1] * 3)):
        scene = traced(*meshes)
        assert interior_camera(*scene, (np.array(low, float), np.array(high, float)), "inside") is None
        assert not sees_only_outside(*scene, None, None)


def test_the_built_in_interior_is_a_room_and_opens_with_its_own_camera():
    scene = built_in("interior")
    embree, normals = traced(*scene.meshes)
    positions = np.concatenate([mesh.positions for mesh in scene.meshes]).astype(np.float64)
    interior = interior_camera(embree, normals, (positions.min(axis=0), positions.max(axis=0)), "inside")
    assert interior is not None
    assert not sees_only_outside(embree, normals, scene.cameras[0], interior)
