"""A near plane: camera rays begin there; what is behind it is as without the clipped surfaces, in all renderers."""

from dataclasses import replace

import numpy as np
import pytest
from shared_bakes import unmeasured
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, studio

from relume.camera.view_samples import sample_view
from relume.core.cache import Cache
from relume.core.errors import ParameterError
from relume.live.free_camera.primary_visibility import trace_primary
from relume.live.opened.openers import open_bake
from relume.methods.registry import METHODS
from relume.output.viewport import Viewport
from relume.raytrace.camera_rays import camera_directions, near_distances, trace_rays
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.scene.custom_camera import make_custom_camera, read_custom_camera, with_cameras
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

__all__ = ["unmeasured"]  # a fixture

SIZE = (48, 36)
PAPER = Material("Paper", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},))


def scene(*, has_wall: bool):
    """A ball before a back wall; perhaps another wall between the camera and the ball."""
    back = quad("back", [[-9, -9, -2], [9, -9, -2], [9, 9, -2], [-9, 9, -2]], 0)
    wall = quad("wall", [[-9, -9, 2], [9, -9, 2], [9, 9, 2], [-9, 9, 2]], 0)
    return make_tiny_scene(
        back, sphere("ball", [0.2, 0.1, 0], 0.8, 0, 24), *([wall] if has_wall else []),
        camera=make_camera("front", (0.3, 0.2, 4), (0.3, 0.2, 0), 0.8), environment=studio(), materials=[PAPER],
    )  # fmt: skip


def clipped(camera):
    """The camera with a near plane between the wall and the ball."""
    return replace(camera, near=2.6)


def test_near_distances_lie_on_a_plane():
    camera = clipped(scene(has_wall=True).cameras[0])
    x, y = np.array([0.5, 24, 47.5], np.float32), np.array([0.5, 18, 35.5], np.float32)
    directions = camera_directions(camera, SIZE, x, y)
    points = near_distances(camera, directions)[:, None] * directions
    np.testing.assert_allclose(points @ -camera.to_world[:3, 2], 2.6, rtol=1e-5)
    assert near_distances(replace(camera, near=0.0), directions) is None


def test_first_hits_are_those_without_the_clipped_wall():
    with_wall, without = (build_scene_buffers(scene(has_wall=w)) for w in (True, False))
    camera = clipped(scene(has_wall=True).cameras[0])
    y, x = np.divmod(np.arange(48 * 36), 48)
    directions = camera_directions(camera, SIZE, (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
    position = camera.to_world[:3, 3].astype(np.float32)
    hits = trace_rays(with_wall.embree, position, directions, start=near_distances(camera, directions))
    expected = trace_rays(without.embree, position, directions)
    np.testing.assert_allclose(hits.distance, expected.distance, rtol=1e-5)
    assert (trace_rays(with_wall.embree, position, directions).distance < hits.distance).all()


def test_the_samples_of_fixed_views_and_the_placement_viewport_are_clipped_alike():
    samples = []
    for has_wall in (True, False):
        each = scene(has_wall=has_wall)
        each = with_cameras(each, [clipped(each.cameras[0])])
        samples.append(sample_view(each, build_scene_buffers(each), "front", SIZE))
    np.testing.assert_array_equal(samples[0].pixel, samples[1].pixel)
    positions, normals = ([getattr(s.surface.points, name) for s in samples] for name in ("position", "normal"))
    np.testing.assert_allclose(*positions, atol=1e-4)
    np.testing.assert_allclose(*normals, atol=1e-4)
    np.testing.assert_array_equal(*(s.camera for s in samples))
    cut, plain = Viewport.from_scene(scene(has_wall=True)), Viewport.from_scene(scene(has_wall=False))
    camera = clipped(scene(has_wall=True).cameras[0])
    np.testing.assert_array_equal(cut.image(camera, SIZE), plain.image(camera, SIZE))
    point = cut.point_at(camera, SIZE, 24, 18)
    np.testing.assert_allclose(point, plain.point_at(camera, SIZE, 24, 18), atol=1e-4)


@pytest.fixture(scope="module")
def transfer(tmp_path_factory, unmeasured):
    recipe = Recipe("probes", ("front",), SIZE, 100, num_probes=600)
    store = tmp_path_factory.mktemp("near") / "store.zarr"
    return open_bake(bake_in_process(METHODS["probes"], scene(has_wall=True), recipe, store), Cache(1 << 30))


def test_the_moving_picture_is_clipped_where_the_exact_one_is(transfer):
    camera = clipped(transfer.views["front"].camera)
    gbuffer = trace_primary(transfer.stored_scene, transfer.embree, camera, SIZE)
    without = build_scene_buffers(scene(has_wall=False))
    position = camera.to_world[:3, 3].astype(np.float32)
    num_pixels = SIZE[0] * SIZE[1]
    expected = trace_rays(without.embree, position, gbuffer.directions[:num_pixels])
    np.testing.assert_allclose(gbuffer.hits.distance[:num_pixels], expected.distance, rtol=1e-5)


@pytest.mark.parametrize("near", [-1.0, float("nan"), float("inf"), 1e10])
def test_impossible_near_planes_are_refused(near):
    with pytest.raises(ParameterError, match="near"):
        make_custom_camera("front", np.eye(4).ravel().tolist(), 40, near)


def test_a_near_plane_survives_json_and_cameras_without_one_keep_their_document():
    plain = make_custom_camera("front", np.eye(4).ravel().tolist(), 40)
    assert set(plain.document()) == {"name", "to_world", "yfov"}
    cut = replace(plain, near=1.5)
    assert read_custom_camera(cut.document()) == cut
    assert cut.camera.near == 1.5
    with pytest.raises(ParameterError, match="near"):
        read_custom_camera(plain.document() | {"near": "1"})
