"""Cameras at random poses: JSON and back, scale removed, and pixels projected to rays and back."""

from __future__ import annotations

import json
import math

import numpy as np
from for_all import for_all
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from relume.output.exr.metadata import world_to_camera, world_to_ndc
from relume.raytrace.camera_rays import camera_directions
from relume.scene.custom_camera import MAX_YFOV, MIN_YFOV, make_custom_camera, read_custom_camera

ROTATIONS = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: math.hypot(*q) > 0.1).map(
    lambda q: Rotation.from_quat(q).as_matrix()
)  # fmt: skip
POSITIONS = st.lists(st.floats(-1e4, 1e4), min_size=3, max_size=3)
ANGLES = st.floats(MIN_YFOV, MAX_YFOV)
NAMES = st.text(
    st.characters(codec="utf-8", exclude_characters="/\\", exclude_categories=["C", "Z"]), min_size=1, max_size=20
)


def pose(rotation: NDArray[np.float64], position: list[float], scale: float = 1.0) -> list[float]:
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = scale * rotation, position
    return [float(number) for number in frame.ravel()]


@for_all(
    60,
    name=NAMES.filter(lambda name: name not in (".", "..")),
    rotation=ROTATIONS,
    position=POSITIONS,
    yfov=ANGLES,
    scale=st.floats(1e-6, 1e6),
)
def test_a_camera_survives_json_and_loses_its_scale(
    name: str, rotation: NDArray[np.float64], position: list[float], yfov: float, scale: float
) -> None:
    camera = make_custom_camera(name, pose(rotation, position, scale), yfov)
    text = json.dumps(camera.document(), allow_nan=False)
    again = read_custom_camera(json.loads(text))
    assert again == camera
    assert json.dumps(again.document()) == text
    np.testing.assert_allclose(camera.camera.to_world.ravel(), pose(rotation, position), atol=1e-9)
    assert camera.camera.yfov == math.radians(yfov)


@for_all(
    60,
    rotation=ROTATIONS,
    position=POSITIONS,
    yfov=ANGLES,
    at=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    distance=st.floats(0.1, 100),
)
def test_a_point_on_a_pixels_ray_is_projected_to_the_pixel(
    rotation: NDArray[np.float64], position: list[float], yfov: float, at: tuple[float, float], distance: float
) -> None:
    camera, size = make_custom_camera("Hero", pose(rotation, position), yfov).camera, (320, 200)
    x, y = (np.array([share * length], np.float32) for share, length in zip(at, size, strict=True))
    (direction,) = camera_directions(camera, size, x, y).astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(direction), 1, atol=1e-6)
    point = np.append(camera.to_world[:3, 3] + distance * direction, 1)
    u, v, _, depth = point @ world_to_ndc(camera, size)
    assert depth > 0
    half_height = math.tan(camera.yfov / 2)
    tolerance = 2e-7 * (1 + 4 * half_height**2) / half_height + 2e-7  # directions are float32
    np.testing.assert_allclose([u / depth, v / depth], at, atol=tolerance)
    np.testing.assert_allclose(np.append(camera.to_world[:3, 3], 1) @ world_to_camera(camera), [0, 0, 0, 1], atol=1e-8)
