"""Poses of cameras, and orbits."""

from __future__ import annotations

import numpy as np
import pytest

from relume_client import look_at
from relume_client.cameras import Orbit


def test_a_camera_looks_along_its_negative_z() -> None:
    pose = look_at([0, 2, 5], [0, 2, 0])
    assert np.allclose(pose, [[1, 0, 0, 0], [0, 1, 0, 2], [0, 0, 1, 5], [0, 0, 0, 1]])
    pose = look_at([3, 0, 0], [0, 0, 0])
    assert np.allclose(pose[:3, :3], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    assert np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3))
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)


@pytest.mark.parametrize(("position", "up"), [([0, 0, 0], [0, 1, 0]), ([0, 3, 0], [0, 1, 0]), ([0, 0, 1], [0, 0, 0])])
def test_directions_must_differ(position: list[float], up: list[float]) -> None:
    with pytest.raises(ValueError, match="cannot look at"):
        look_at(position, [0, 0, 0], up)


def test_orbit_of_a_pose_has_the_same_pose() -> None:
    pose = look_at([3, 2, 4], [0.5, 1, 0])
    orbit = Orbit.from_pose(pose, [0, 1, 0])
    assert np.allclose(orbit.pose(), pose)
    towards = (np.array([0.5, 1, 0]) - [3, 2, 4]) / np.linalg.norm(np.array([2.5, 1, 4]))
    assert orbit.distance == pytest.approx(np.dot([-3, -1, -4], towards))  # nearest to the middle


def test_orbit_turns_about_its_pivot() -> None:
    orbit = Orbit.from_pose(look_at([0, 0, 4], [0, 0, 0]), [0, 0, 0])
    assert np.allclose(orbit.turned(np.pi / 2, 0).pose(), look_at([4, 0, 0], [0, 0, 0]))
    assert np.allclose(orbit.turned(0, np.radians(30), 0.5).pose()[:3, 3], [0, 1, np.sqrt(3)])
    assert np.isfinite(orbit.turned(0, 10).pose()).all()  # it stops below the pole
