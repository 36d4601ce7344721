"""The camera placement viewport: positions and distinguishable surfaces."""

import numpy as np
import pytest
from tiny_scenes import quad

from relume.assets.environments.environment import Environment
from relume.core.color import srgb_decode
from relume.output.viewport import Viewport
from relume.scene.examples.catalog import BUILT_IN, built_in
from relume.scene.model import Camera, Material, Texture
from relume.scene.scene_folder import make_scene

SIZE = (64, 48)


def facing(distance: float) -> Camera:
    """A camera on the +Z axis that looks at the origin."""
    to_world = np.eye(4)
    to_world[2, 3] = distance
    return Camera("eye", to_world, 0.8)


@pytest.fixture(scope="module")
def walls() -> Viewport:
    """A red wall on the left and a mirror with greenish texture on the right, both in the plane z = 0."""
    left = quad("left", [[-1, -1, 0], [0, -1, 0], [0, 1, 0], [-1, 1, 0]], 0)
    right = quad("right", [[0, -1, 0], [1, -1, 0], [1, 1, 0], [0, 1, 0]], 1)
    red = Material("Red", ({"model": "lambert", "color": [0.8, 0.1, 0.1]},))
    green = np.tile(np.array([0.2, 0.9, 0.2], np.float32), (4, 4, 1))
    printed = Material(
        "Printed", ({"model": "lambert", "color": [1, 1, 1], "texture": "diffuse"},), {"diffuse": Texture(green)}
    )
    environment = Environment("sky", np.ones((8, 16, 3), np.float32))
    return Viewport.from_scene(make_scene("Walls", [left, right], [red, printed], [facing(3)], environment))


def test_surfaces_have_their_colors_and_positions(walls: Viewport) -> None:
    image = walls.image(facing(3), SIZE)
    assert image.shape == (48, 64, 3)
    assert image.dtype == np.uint8
    left, right, outside = image[24, 24], image[24, 40], image[1, 1]
    assert left[0] > 2 * left[1]
    assert right[1] > 1.5 * right[0]
    assert outside.max() < 60
    point = walls.point_at(facing(3), SIZE, 32 + 8, 24 - 4)
    step = 2 * 3 * np.tan(0.4) / 48  # meters per pixel, in the plane
    np.testing.assert_allclose(point, [8 * step, 4 * step, 0], atol=1e-5)
    assert walls.point_at(facing(3), SIZE, 1, 1) is None


def test_a_surface_is_darker_at_grazing_angles(walls: Viewport) -> None:
    aside, turn = facing(0), np.radians(70)
    aside.to_world[:3, 0] = [np.cos(turn), 0, -np.sin(turn)]
    aside.to_world[:3, 2] = [np.sin(turn), 0, np.cos(turn)]
    aside.to_world[:3, 3] = 3 * aside.to_world[:3, 2]
    straight, slanted = (srgb_decode(walls.image(camera, SIZE)[24, 30] / 255.0) for camera in (facing(3), aside))
    np.testing.assert_allclose(slanted / straight, 0.604 / 0.9, rtol=0.05)  # ratio of the light terms


@pytest.mark.parametrize("name", BUILT_IN)
def test_the_default_camera_frames_the_scene(name: str) -> None:
    scene = built_in(name)
    viewport = Viewport.from_scene(scene)
    image = viewport.image(viewport.default_camera, SIZE)
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 20
    positions = np.concatenate([mesh.positions[mesh.faces.ravel()] for mesh in scene.meshes])
    assert (viewport.bounds_min <= positions.min(axis=0) + 1e-6).all()
    assert (viewport.bounds_max >= positions.max(axis=0) - 1e-6).all()
    point = viewport.point_at(viewport.default_camera, SIZE, 32, 24)
    assert point is not None
    assert (point >= viewport.bounds_min - 1e-3).all()
    assert (point <= viewport.bounds_max + 1e-3).all()
