"""Rooms without a camera: the first view is inside."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from relume.scene_io.import_scene import import_scene

SIDES = np.array([4.0, 3.0, 5.0])
CORNERS = [SIDES * corner for corner in itertools.product((0, 1), repeat=3)]
OUTWARD = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")


def box(faces):
    lines = [*("v {} {} {}".format(*corner) for corner in CORNERS), *(f"f {face}" for face in faces)]
    return import_scene("\n".join(lines).encode(), "box")


def is_inside(camera):
    position = camera.to_world[:3, 3]
    return bool(((position > 0) & (position < SIDES)).all())


def test_a_closed_room_opens_inside():
    (camera,) = box([" ".join(reversed(face.split())) for face in OUTWARD]).cameras
    assert is_inside(camera)
    assert camera.name == "front"
    assert camera.to_world[1, 3] == pytest.approx(1.6, abs=0.2)


@pytest.mark.parametrize("faces", [OUTWARD, OUTWARD[:3]], ids=["a solid", "an open corner"])
def test_other_scenes_open_outside(faces):
    (camera,) = box(faces).cameras
    assert not is_inside(camera)
