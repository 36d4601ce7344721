"""Camera paths: turntables are closed, and interpolated paths pass through every camera."""

from types import SimpleNamespace

import numpy as np
import pytest

from relume.live.free_camera.camera_paths import interpolate_cameras, pivot_of, turntable
from relume.raytrace.embree import EmbreeScene
from relume.scene.model import Camera


def camera(position, turn=0.0, yfov=0.7):
    cosine, sine = np.cos(turn), np.sin(turn)
    to_world = np.eye(4)
    to_world[:3, :3] = [[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]
    to_world[:3, 3] = position
    return Camera("front", to_world, yfov)


def test_a_turntable_keeps_the_center_and_is_closed():
    cameras = turntable(camera([1, 1.5, 9]), np.array([1.0, 1, 3]), 12)
    np.testing.assert_array_equal(cameras[0].to_world, camera([1, 1.5, 9]).to_world)
    center = np.array([1.0, 1, 3, 1])
    centers = np.array([np.linalg.inv(pose.to_world) @ center for pose in cameras])
    np.testing.assert_allclose(centers, np.tile(centers[0], (12, 1)), atol=1e-12)
    steps = [np.linalg.norm(cameras[k].to_world - cameras[k - 1].to_world) for k in range(12)]
    np.testing.assert_allclose(steps, steps[0])
    assert cameras[3].to_world[0, 3] > 3  # first to the right


def test_the_pivot_is_the_surface_at_the_image_center_or_the_scene_depth():
    near, far = ([[x, y, z] for x, y in ((1.5, 0), (3, 0), (2, 3))] for z in (3.7, 3.1))  # of one material
    aside = [[8, 0, 0], [9, 0, 0], [8, 1, 0]]
    positions, faces = np.array([*near, *far, *aside], np.float32), np.arange(9, dtype=np.uint32).reshape(3, 3)
    view = SimpleNamespace(bounds=(np.array([-1.0, 0, 2]), np.array([3.0, 2, 4])))
    stored_scene = SimpleNamespace(faces=faces, face_material=np.array([1, 1, 0]))
    scene = EmbreeScene.build(positions, faces)
    transfer = SimpleNamespace(stored_scene=stored_scene, positions=positions, embree=scene, views={"front": view})
    np.testing.assert_allclose(pivot_of(transfer, camera([2, 1.5, 9])), [2, 1.5, 3.4], atol=1e-6)
    np.testing.assert_allclose(pivot_of(transfer, camera([0, 1.5, 9])), [0, 1.5, 3], atol=1e-12)
    np.testing.assert_allclose(pivot_of(transfer, camera([0, 1.5, -9])), [1, 1, 3], atol=1e-12)


def test_a_path_passes_through_its_cameras_with_valid_rotations():
    keys = [camera([0, 1, 5]), camera([4, 2, 3], 0.9, 0.5), camera([5, 1, -1], 2.0, 1.0)]
    cameras = interpolate_cameras(keys, 9)
    for key, frame in zip(keys, cameras[::4], strict=True):
        np.testing.assert_allclose(frame.to_world, key.to_world, atol=1e-12)
        assert frame.yfov == pytest.approx(key.yfov)
    for frame in cameras:
        rotation = frame.to_world[:3, :3]
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) > 0
    assert all(0.5 <= frame.yfov <= 1.0 for frame in cameras)


@pytest.mark.parametrize("num", [1, 2, 7])
def test_a_path_of_one_camera_is_constant(num):
    assert [pose.to_world.tolist() for pose in interpolate_cameras([camera([0, 1, 5])], num)] == [
        camera([0, 1, 5]).to_world.tolist()
    ] * num


def test_as_many_frames_as_cameras_are_the_cameras():
    keys = [camera([0, 1, 5]), camera([4, 2, 3], 0.9)]
    assert interpolate_cameras(keys, 2) == keys


def test_a_path_reaches_its_cameras_after_their_durations():
    keys = [camera([0, 1, 5]), camera([4, 2, 3], 0.9, 0.5), camera([5, 1, -1], 2.0, 1.0)]
    cameras = interpolate_cameras(keys, 5, [1.0, 3.0])
    for key, frame in zip(keys, (cameras[0], cameras[1], cameras[4]), strict=True):
        np.testing.assert_allclose(frame.to_world, key.to_world, atol=1e-12)
    assert interpolate_cameras(keys, 3, [1.0, 3.0])[1].to_world[0, 3] > keys[1].to_world[0, 3]
