"""Surface points of rays that hit the edge of a triangle."""

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, mesh, quad

from relume.math.plane_rounding import ROUNDING
from relume.raytrace.camera_rays import Hits
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.surface_interaction import surface_at

INWARD = np.array([[-1.0, 0.0, 0.0]], np.float32)  # along the ray that hits the wall


def on_wall(uv, corners=((0, 0, 0), (0, 0, 2), (0, 2, 2), (0, 2, 0))):
    """The point of a wall in x = 0 at barycentric coordinates of its first triangle."""
    floor = quad("floor", [[0, 0, 0], [2, 0, 0], [2, 0, 2], [0, 0, 2]], 0)
    geometry = build_scene_buffers(
        make_tiny_scene(quad("wall", corners, 0), floor, camera=make_camera("c", [1, 1, 1], [0, 1, 1], 1.0))
    )
    hits = Hits(np.zeros(1, np.int32), np.array([uv], np.float32), np.ones(1, np.float32))
    return surface_at(geometry, hits, INWARD).points.position[0].astype(float), float(geometry.origins.offset[0])


@pytest.mark.parametrize("uv", [(0.4, 0.0), (0.0, 0.0), (1.0, 0.0)], ids=["edge", "corner", "other corner"])
def test_a_point_on_an_edge_is_moved_away_from_the_adjacent_surface(uv):
    """On the edge it would see through the floor, in whose plane it lies."""
    position, offset = on_wall(uv)
    assert 8 * ROUNDING < position[1] < 64 * ROUNDING  # the wall is 2 m wide
    assert position[0] == pytest.approx(offset, rel=1e-6)
    assert offset == pytest.approx(2 * ROUNDING)  # in the plane x = 0, only the extent counts


def test_other_points_are_unchanged():
    position, offset = on_wall((0.3, 0.3))
    np.testing.assert_allclose(position, [offset, 0.6, 1.2], rtol=1e-6)


def test_a_point_of_a_sliver_stays_in_it():
    """In a triangle narrower than the minimum distance, the distance is a tenth of its height."""
    subsampled = 1e-7
    geometry = build_scene_buffers(
        make_tiny_scene(
            mesh("sliver", [[0, 0, 0], [0, 0, 2], [0, subsampled, 1]], [[0, 1, 2]], 0),
            camera=make_camera("c", [1, 1, 1], [0, 1, 1], 1.0),
        )
    )
    hits = Hits(np.zeros(1, np.int32), np.array([[0.5, 0.0]], np.float32), np.ones(1, np.float32))
    height = surface_at(geometry, hits, INWARD).points.position[0, 1]
    assert 0 < height < subsampled
