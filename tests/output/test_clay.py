"""Clay pictures: silhouettes and shading of known shapes."""

import numpy as np
import pytest
from tiny_scenes import mesh, quad

from relume.assets.environments.environment import Environment
from relume.core.color import srgb_encode
from relume.output.clay import ALBEDO, AMBIENT, BACKGROUND, LIGHT, TO_LIGHT, clay_image
from relume.raytrace.scene_buffers import SceneBuffers, build_scene_buffers
from relume.scene.model import Camera, Glass, Material, Mesh
from relume.scene.scene_folder import make_scene

YFOV = 2 * np.arctan(0.5)  # an image as high as its distance
SIZE = (80, 60)


def facing(distance: float, near: float = 0.0) -> Camera:
    """A camera on the +Z axis that looks at the origin."""
    to_world = np.eye(4)
    to_world[2, 3] = distance
    return Camera("front", to_world, YFOV, near=near)


def buffers(*meshes: Mesh, material: Material | None = None) -> SceneBuffers:
    white = material or Material("White", ({"model": "lambert", "color": [1, 1, 1]},))
    environment = Environment("studio", np.ones((8, 16, 3), np.float32))
    return build_scene_buffers(make_scene("Shapes", list(meshes), [white], [facing(3)], environment))


def box(width: float, height: float, depth: float) -> Mesh:
    """A box about the origin without its back, each side flat."""
    x, y, z = width / 2, height / 2, depth / 2
    corners = [
        [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]],
        [[x, -y, z], [x, -y, -z], [x, y, -z], [x, y, z]],
        [[-x, -y, -z], [-x, -y, z], [-x, y, z], [-x, y, -z]],
        [[-x, y, z], [x, y, z], [x, y, -z], [-x, y, -z]],
        [[-x, -y, -z], [x, -y, -z], [x, -y, z], [-x, -y, z]],
    ]
    faces = [[4 * k + i for i in triangle] for k in range(5) for triangle in ([0, 1, 2], [0, 2, 3])]
    normals = np.repeat([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], 4, axis=0)
    return mesh("box", np.reshape(corners, (-1, 3)), faces, 0, normals=normals)


def gray(linear: float) -> int:
    return int(np.rint(255 * srgb_encode(np.array([linear]))[0]))


def test_the_silhouette_of_a_box_is_its_projection() -> None:
    image = clay_image(buffers(box(2, 1, 1)), facing(2.5), SIZE)  # its front is 2 m away: 30 pixels per meter
    rows, columns = np.nonzero(image != gray(BACKGROUND))
    assert image.shape == (60, 80)
    assert (rows.min(), rows.max()) == (15, 44)
    assert (columns.min(), columns.max()) == (10, 69)
    assert len(rows) == 30 * 60


def test_an_unoccluded_surface_has_the_light_of_its_angle() -> None:
    image = clay_image(buffers(box(2, 1, 1)), facing(2.5), SIZE)
    assert image[30, 40] == gray(ALBEDO * (LIGHT * TO_LIGHT[2] + AMBIENT))


def test_both_sides_of_a_surface_are_lit() -> None:
    corners = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    front, back = (clay_image(buffers(quad("wall", order, 0)), facing(2), SIZE) for order in (corners, corners[::-1]))
    np.testing.assert_array_equal(front, back)
    assert front[30, 40] > gray(BACKGROUND)


def test_corners_are_darker() -> None:
    wall = quad("wall", [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], 0)
    floor = quad("floor", [[-1, -0.5, 1], [1, -0.5, 1], [1, -0.5, 0], [-1, -0.5, 0]], 0)
    column = clay_image(buffers(wall, floor), facing(2), SIZE)[:, 40].astype(int)
    edge = 45  # the wall meets the floor 0.5 m below the axis, at 60 pixels per 2 m
    assert column[20] - column[edge - 1] > 10
    assert (np.diff(column[20:edge]) <= 1).all()


def test_glass_is_visible() -> None:
    pane = quad("pane", [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], 0)
    glass = Material("Glass", ({"model": "lambert", "color": [0, 0, 0]},), glass=Glass())
    assert clay_image(buffers(pane, material=glass), facing(2), SIZE)[30, 40] > gray(BACKGROUND)


def test_the_near_plane_clips() -> None:
    wall = quad("wall", [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], 0)
    image = clay_image(buffers(wall), facing(2, near=2.5), SIZE)
    assert (image == gray(BACKGROUND)).all()


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_the_picture_does_not_depend_on_the_unit(scale: float) -> None:
    images = [
        clay_image(buffers(box(2 * s, s, s), box(s / 2, 2 * s, s / 2)), facing(2.5 * s), SIZE) for s in (1.0, scale)
    ]
    assert np.abs(images[0].astype(int) - images[1]).mean() < 0.5
