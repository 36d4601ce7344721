"""Camera paths: a turntable, or a path through given cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation, RotationSpline

from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.raytrace.alpha_filter import IGNORE_GLASS
from relume.raytrace.camera_rays import near_distances, trace_rays
from relume.scene.model import Camera

F64 = NDArray[np.float64]


def pivot_of(transfer: FreeCameraTransfer, camera: Camera) -> Shaped[F64, " 3"]:
    """Return the pivot of a camera's view, a point on its optical axis, in meters.

    Its depth is that of the center of all geometry with the material at the image center, which is close to an object's
    axis rather than its front; a scene's table or backdrop is often far larger than the object. If the image center
    shows nothing, it is the depth of the scene's center; if that center is behind the camera, the pivot is the center
    itself.

    Args:
        transfer: transfer of a bake. camera: any.
    """
    position, forward, stored_scene = camera.to_world[:3, 3], -camera.to_world[:3, 2], transfer.stored_scene
    ray = position.astype(np.float32), forward[None].astype(np.float32)
    face = int(trace_rays(transfer.embree, *ray, IGNORE_GLASS, start=near_distances(camera, ray[1])).face[0])
    bounds = next(iter(transfer.views.values())).bounds
    if face >= 0:
        has_same_material = stored_scene.face_material == stored_scene.face_material[face]
        corners = transfer.positions[stored_scene.faces[has_same_material].ravel()]
        bounds = corners.min(axis=0), corners.max(axis=0)
    center = (bounds[0] + bounds[1]).astype(np.float64) / 2
    depth = (center - position) @ forward
    pivot: F64 = position + depth * forward if depth > 0 else center
    return pivot


def turntable(camera: Camera, pivot: Shaped[F64, " 3"], num_cameras: int) -> list[Camera]:
    """Return cameras of one turn about a vertical axis, to the right, ending one step before the start.

    Args:
        camera: the first one; height, distance and elevation stay.
        pivot: a point on the axis, meters. num_cameras: at least 1.
    """
    cameras = []
    for angle in 2 * np.pi * np.arange(num_cameras) / num_cameras:
        rotation, to_world = Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix(), camera.to_world.copy()
        to_world[:3, :3] = rotation @ to_world[:3, :3]
        to_world[:3, 3] = pivot + rotation @ (to_world[:3, 3] - pivot)
        cameras.append(replace(camera, to_world=to_world))
    return cameras


def interpolate_cameras(
    cameras: Sequence[Camera], num_cameras: int, durations: Sequence[float] | None = None
) -> list[Camera]:
    """Interpolate from the first camera to the last through all others, at equal time steps.

    Positions follow monotone cubics (PCHIP), orientations a rotation spline, and fields of view cubics of their
    logarithm; near planes follow cubics.

    Args:
        cameras: at least one. num_cameras: number of cameras on the path, ends included.
        durations: time between cameras, one less than these, positive; None for equal ones.
    """
    if len(cameras) == 1:
        return [cameras[0]] * num_cameras
    if len(cameras) == num_cameras and durations is None:
        return list(cameras)
    keys = np.arange(len(cameras)) if durations is None else np.concatenate([[0.0], np.cumsum(durations)])
    times = np.linspace(0, keys[-1], num_cameras)
    frames = np.array([camera.to_world for camera in cameras])
    positions = PchipInterpolator(keys, frames[:, :3, 3])(times)
    rotations = RotationSpline(keys, Rotation.from_matrix(frames[:, :3, :3]))(times).as_matrix()
    angles = np.exp(PchipInterpolator(keys, np.log([camera.yfov for camera in cameras]))(times))
    nears = PchipInterpolator(keys, [camera.near for camera in cameras])(times)
    path = []
    for position, rotation, yfov, near in zip(positions, rotations, angles, nears, strict=True):
        to_world = np.eye(4)
        to_world[:3, :3], to_world[:3, 3] = rotation, position
        path.append(replace(cameras[0], to_world=to_world, yfov=float(yfov), near=float(near)))
    return path
