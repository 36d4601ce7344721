"""A shadow-catcher ground under a scene: position, size, and the unchanged scene."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, still_life

from relume.core.errors import SceneError
from relume.scene.scene_folder import load_scene, save_scene
from relume.scene.shadow_catcher_ground import with_ground

CAMERA = make_camera("front", (0, 2, 5), (0, 1, 0), 0.6)


def test_the_ground_lies_below_the_scene_and_extends_far():
    scene = make_tiny_scene(sphere("ball", (3.0, 1.0, -2.0), 0.5, 0), camera=CAMERA)
    ground = with_ground(scene)
    disc = ground.meshes[-1]
    low = min(mesh.positions[:, 1].min() for mesh in scene.meshes)
    assert low - 0.01 < disc.positions[:, 1].max() < low
    away = np.linalg.norm(disc.positions[1:, [0, 2]] - [3.0, -2.0], axis=1)
    assert away.min() > 8 * 0.5
    a, b, c = disc.positions[disc.faces].transpose(1, 0, 2)
    assert (np.cross(b - a, c - a)[:, 1] > 0).all()
    assert ground.id != scene.id
    assert ground.meshes[:-1] == scene.meshes
    assert ground.cameras == scene.cameras


def test_flat_scenes_get_a_ground():
    level = quad("level", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    upright = quad("upright", [[0, 0, 0], [0, 0, 0.001], [0, 2, 0.001], [0, 2, 0]], 0)
    for mesh in (level, upright):
        disc = with_ground(make_tiny_scene(mesh, camera=CAMERA)).meshes[-1].positions
        assert disc[:, 1].max() < 0
        assert np.ptp(disc[:, 0]) > 10


def test_the_ground_has_a_unique_name_and_is_added_once(tmp_path):
    scene = still_life()
    ground = with_ground(scene, "With a ground")
    assert [m.name for m in ground.materials] == [*(m.name for m in scene.materials), "Ground"]
    assert ground.name == "With a ground"
    save_scene(ground, tmp_path)
    assert load_scene(tmp_path).materials[-1].shadow_catcher
    with pytest.raises(SceneError, match="already"):
        with_ground(ground)
