"""Ways that an eye goes: once around what there is to see, or from camera to camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation, RotationSpline

from relume.scene.model import Camera

F64 = NDArray[np.float64]


def looked_at(camera: Camera, bounds: tuple[F64, F64]) -> F64:
    """What is likely in the middle of a camera's picture: straight before it, as deep as the middle of the scene is.

    The middle itself where that is behind. A scene's table or backdrop is often far larger than what it is about.

    Args:
        camera: any. bounds: lowest and highest corner of the scene, metres. (3,) each.
    Returns:
        Metres. (3,)
    """
    middle, forward, place = (bounds[0] + bounds[1]) / 2, -camera.to_world[:3, 2], camera.to_world[:3, 3]
    depth = (middle - place) @ forward
    found: F64 = place + depth * forward if depth > 0 else middle
    return found


def turntable(camera: Camera, about: F64, num: int) -> list[Camera]:
    """Go once around an upright line, to the right, ending one step before the start.

    Args:
        camera: that it begins at; height, distance and what is above stay.
        about: a place on the line, metres. (3,). num: of cameras, at least 1.
    """
    cameras = []
    for angle in 2 * np.pi * np.arange(num) / num:
        turn, to_world = Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix(), camera.to_world.copy()
        to_world[:3, :3] = turn @ to_world[:3, :3]
        to_world[:3, 3] = about + turn @ (to_world[:3, 3] - about)
        cameras.append(replace(camera, to_world=to_world))
    return cameras


def along(cameras: Sequence[Camera], num: int) -> list[Camera]:
    """Go from the first camera to the last, through those between, at even shares of the frames.

    Places follow cubics that do not overshoot, directions a spline of rotations, fields of view cubics of their
    logarithm.

    Args:
        cameras: at least one. num: of cameras on the way, ends included.
    """
    if len(cameras) == num or len(cameras) == 1:
        return list(cameras) if len(cameras) == num else [cameras[0]] * num
    at, keys = np.linspace(0, len(cameras) - 1, num), np.arange(len(cameras))
    frames = np.array([camera.to_world for camera in cameras])
    places = PchipInterpolator(keys, frames[:, :3, 3])(at)
    turns = RotationSpline(keys, Rotation.from_matrix(frames[:, :3, :3]))(at).as_matrix()
    angles = np.exp(PchipInterpolator(keys, np.log([camera.yfov for camera in cameras]))(at))
    found = []
    for place, turn, yfov in zip(places, turns, angles, strict=True):
        to_world = np.eye(4)
        to_world[:3, :3], to_world[:3, 3] = turn, place
        found.append(replace(cameras[0], to_world=to_world, yfov=float(yfov)))
    return found
