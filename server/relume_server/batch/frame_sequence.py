"""Look and camera of each frame of a batch, and the camera of a comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from relume import look as looks
from relume.core.errors import Description, ParameterError
from relume.live.fixed_camera.protocols import CameraMode, CameraView, OpenBake
from relume.look import Look
from relume.look.interpolate import enclosing_keyframes, interpolate_looks
from relume.look.rotate import rotated_environment, rotated_lights
from relume_server.schemas.bodies import ComparisonRequest
from relume_server.schemas.cameras import CameraFrame
from relume_server.schemas.renders import Animation, CameraPath, Keyframes, LooksRequest, Turntable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from relume.live.free_camera.free_view import FreeView
    from relume.live.free_camera.protocol import FreeCameraTransfer
    from relume.scene.model import Camera

_MIN_PATH_POINTS = 64


def check_animation(request: Animation, view: str, transfer: OpenBake) -> Sequence[Camera | None]:
    """Check that a bake supports a batch, and return the camera of each frame; None for the baked one.

    Raises:
        ParameterError: what is not supported, and what is.
    """
    path, num_frames = request.path, request.num_frames
    if path is not None and transfer.camera_mode is not CameraMode.FREE and not _has_fixed_camera(path):
        allowed = "no path, because this bake has fixed cameras, or bake the scene with method probes"
        raise ParameterError("path", _path_text(path), allowed)
    if isinstance(path, Turntable) and request.frames not in (None, path.turntable):
        raise ParameterError("frames", request.frames, f"{path.turntable}, as in turntable, or leave it out")
    num_cameras = 0 if path is None or isinstance(path, Turntable) else len(path.cameras)
    if num_cameras > num_frames:
        value = Description(f"a list of {num_cameras} cameras")
        raise ParameterError("path/cameras", value, f"at most one camera per frame, {num_frames} in total")
    return cameras_of(request, view, transfer)


def _path_text(path: Turntable | CameraPath) -> str:
    return f"turntable {path.turntable}" if isinstance(path, Turntable) else f"{len(path.cameras)} cameras"


def _has_fixed_camera(path: Turntable | CameraPath) -> bool:
    return isinstance(path, Turntable) and path.rotate == "environment" and path.start_camera is None


def cameras_of(request: Animation, name: str, transfer: OpenBake) -> Sequence[Camera | None]:
    """Camera of each frame; None for the baked one. Raises ParameterError for invalid cameras."""
    from relume.live.free_camera.camera_paths import (  # imports SciPy, which describing the API does not need
        interpolate_cameras,
        turntable,
    )

    if transfer.camera_mode is not CameraMode.FREE:
        return [None] * request.num_frames
    view = cast("FreeView", transfer.views[name])
    if request.path is None:
        return [view.camera] * request.num_frames

    if isinstance(request.path, Turntable):
        start = _start_camera(request.path, view)
        if request.path.rotate == "environment":
            return [start] * request.num_frames
        return turntable(start, _turntable_pivot(request.path, view, transfer), request.num_frames)
    cameras = [_camera_of_frame(view, frame) for frame in request.path.cameras]
    durations = request.durations if len(cameras) == len(request.looks) else None
    return interpolate_cameras(cameras, request.num_frames, durations)


def crossed_material(request: Animation, name: str, transfer: OpenBake) -> str | None:
    """Return the material of the first surface that the camera's path crosses; None if it crosses none, or is fixed.

    Args:
        request: the animation. name: of the view. transfer: the bake.
    """
    path = request.path
    if path is None or transfer.camera_mode is not CameraMode.FREE or _has_fixed_camera(path):
        return None
    if isinstance(path, Turntable):  # chords of few frames would cut through what a turn goes around
        path = path.model_copy(update={"turntable": max(path.turntable, _MIN_PATH_POINTS)})
    cameras = [camera for camera in cameras_of(request.model_copy(update={"path": path}), name, transfer) if camera]
    corners = [*cameras, cameras[0]] if isinstance(path, Turntable) else cameras
    free_camera = cast("FreeCameraTransfer", transfer)
    obstacle = free_camera.first_obstacle(np.array([camera.to_world[:3, 3] for camera in corners]))
    if obstacle is None:
        return None
    return free_camera.material_names[int(free_camera.stored_scene.face_material[obstacle.face])]


def _camera_of_frame(view: CameraView, frame: CameraFrame) -> Camera:
    return frame.custom_camera(view.name).camera


def comparison_camera(request: ComparisonRequest, transfer: OpenBake) -> tuple[Camera, tuple[int, int]]:
    """Camera and image size of a comparison. Raises ParameterError for invalid cameras."""
    view = transfer.views[request.view]
    camera = view.camera if request.camera is None else _camera_of_frame(view, request.camera)
    return camera, request.size or (view.width, view.height)


def _start_camera(path: Turntable, view: FreeView) -> Camera:
    return view.camera if path.start_camera is None else _camera_of_frame(view, path.start_camera)


def _turntable_pivot(path: Turntable, view: FreeView, transfer: OpenBake) -> NDArray[np.float64]:
    from relume.live.free_camera.camera_paths import pivot_of

    if path.pivot is not None:
        return np.array(path.pivot)
    return pivot_of(cast("FreeCameraTransfer", transfer), _start_camera(path, view))


def with_pivot(request: LooksRequest, transfer: OpenBake) -> LooksRequest:
    """Fill in the pivot of a rotating object, so that it is not computed for each frame."""
    path = request.path
    if request.view is None or not isinstance(path, Turntable) or path.rotate != "object":
        return request
    pivot = _turntable_pivot(path, cast("FreeView", transfer.views[request.view]), transfer)
    return request.model_copy(update={"path": path.model_copy(update={"pivot": pivot.tolist()})})


def look_at_frame(request: Animation, view: str, transfer: OpenBake, index: int) -> Look:
    """Validated look of a frame: a keyframe or interpolated, with the environment or object rotated by `path`."""
    default = transfer.default_look
    return looks.validate(look_document_at_frame(request, view, transfer, index), default)


def look_document_at_frame(request: Animation, view: str | None, transfer: OpenBake, index: int) -> Mapping[str, Any]:
    """Complete look document of a frame, see `look_at_frame`; `view` may be None without a path."""
    document = _interpolated_document(request, transfer.default_look, index)
    if not isinstance(request.path, Turntable) or request.path.rotate == "camera":
        return document
    degrees = 360 * index / request.num_frames
    if request.path.rotate == "environment":
        return rotated_environment(document, degrees)
    pivot = _turntable_pivot(request.path, cast("FreeView", transfer.views[cast("str", view)]), transfer)
    return rotated_lights(document, degrees, pivot.tolist())


def _interpolated_document(request: Keyframes, default: Mapping[str, Any], index: int) -> Mapping[str, Any]:
    """Interpolate the look document of a frame; only its two keyframes are completed."""
    if len(request.looks) == request.num_frames and request.durations is None:
        return looks.complete(request.looks[index], default)
    position = index / max(1, request.num_frames - 1)
    first, second, weight = enclosing_keyframes(len(request.looks), position, request.durations)
    keys = dict.fromkeys((first, second))  # only one if the frame is a keyframe
    return interpolate_looks([looks.complete(request.looks[k], default) for k in keys], weight, request.interpolation)
