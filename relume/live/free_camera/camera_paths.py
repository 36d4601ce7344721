"""Ways that an eye goes: once around what there is to see, or from camera to camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation, RotationSpline

from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.raytrace.alpha_filter import IGNORE_GLASS
from relume.raytrace.camera_rays import trace_rays
from relume.scene.model import Camera

F64 = NDArray[np.float64]


def pivot_of(transfer: FreeCameraTransfer, camera: Camera) -> F64:
    """What a camera's picture is about: a place straight before it.

    It is as deep as the middle of all that is of the material in the middle of the picture, which is an object's axis
    rather than its front; a scene's table or backdrop is often far larger than what stands there. Where the middle
    shows nothing it is as deep as the scene's; the middle itself where that is behind.

    Args:
        transfer: of a bake. camera: any.
    Returns:
        Metres. (3,)
    """
    position, forward, stored_scene = camera.to_world[:3, 3], -camera.to_world[:3, 2], transfer.stored_scene
    ray = position.astype(np.float32), forward[None].astype(np.float32)
    face = int(trace_rays(transfer.embree, *ray, IGNORE_GLASS).face[0])
    bounds = next(iter(transfer.views.values())).bounds
    if face >= 0:
        has_same_material = stored_scene.face_material == stored_scene.face_material[face]
        corners = transfer.positions[stored_scene.faces[has_same_material].ravel()]
        bounds = corners.min(axis=0), corners.max(axis=0)
    center = (bounds[0] + bounds[1]).astype(np.float64) / 2
    depth = (center - position) @ forward
    pivot: F64 = position + depth * forward if depth > 0 else center
    return pivot


def turntable(camera: Camera, pivot: F64, num_cameras: int) -> list[Camera]:
    """Go once around an upright line, to the right, ending one step before the start.

    Args:
        camera: that it begins at; height, distance and what is above stay.
        pivot: a place on the line, metres. (3,). num_cameras: of cameras, at least 1.
    """
    cameras = []
    for angle in 2 * np.pi * np.arange(num_cameras) / num_cameras:
        rotation, to_world = Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix(), camera.to_world.copy()
        to_world[:3, :3] = rotation @ to_world[:3, :3]
        to_world[:3, 3] = pivot + rotation @ (to_world[:3, 3] - pivot)
        cameras.append(replace(camera, to_world=to_world))
    return cameras


def interpolate_cameras(cameras: Sequence[Camera], num_cameras: int) -> list[Camera]:
    """Go from the first camera to the last, through those between, at even shares of the frames.

    Places follow cubics that do not overshoot, directions a spline of rotations, fields of view cubics of their
    logarithm.

    Args:
        cameras: at least one. num_cameras: of cameras on the way, ends included.
    """
    if len(cameras) == num_cameras or len(cameras) == 1:
        return list(cameras) if len(cameras) == num_cameras else [cameras[0]] * num_cameras
    times, keys = np.linspace(0, len(cameras) - 1, num_cameras), np.arange(len(cameras))
    frames = np.array([camera.to_world for camera in cameras])
    positions = PchipInterpolator(keys, frames[:, :3, 3])(times)
    rotations = RotationSpline(keys, Rotation.from_matrix(frames[:, :3, :3]))(times).as_matrix()
    angles = np.exp(PchipInterpolator(keys, np.log([camera.yfov for camera in cameras]))(times))
    path = []
    for position, rotation, yfov in zip(positions, rotations, angles, strict=True):
        to_world = np.eye(4)
        to_world[:3, :3], to_world[:3, 3] = rotation, position
        path.append(replace(cameras[0], to_world=to_world, yfov=float(yfov)))
    return path
