"""What each frame of a batch shows: from where, and under which look."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

from relume import look as looks
from relume.errors import ParameterError
from relume.look import Look
from relume.look.morph import morph, neighbours
from relume.picture.transfer import Eyes, Opened
from relume.scene.placed_camera import placed_camera
from server.wire.cameras import CameraFrame
from server.wire.renders import Animation, Keyframes, Turntable

if TYPE_CHECKING:
    from relume.moving.view import FreeView
    from relume.scene.model import Camera


def check_animation(request: Animation, view: str, transfer: Opened) -> Sequence[Camera | None]:
    """Whether a bake can follow a batch, and where each frame is seen from; None where it was baked.

    Raises:
        ParameterError: what cannot be, and what can.
    """
    path, num = request.path, request.num_frames
    if path is not None and transfer.eyes is not Eyes.FREE:
        raise ParameterError("path", "a path", "none: the eye of this bake does not move; bake by method surface")
    if isinstance(path, Turntable) and request.frames not in (None, path.turntable):
        raise ParameterError("frames", request.frames, f"{path.turntable}, as the turntable says, or nothing")
    num_eyes = 0 if path is None or isinstance(path, Turntable) else len(path.eyes)
    if num_eyes > num:
        raise ParameterError("path/eyes", f"{num_eyes} keyframes", f"at most as many as frames, {num}")
    return eyes_of(request, view, transfer)


def eyes_of(request: Animation, name: str, transfer: Opened) -> Sequence[Camera | None]:
    """Where each frame is seen from; None where it was baked. Raises ParameterError for bad cameras."""
    from relume.moving.paths import along, turntable  # SciPy, which a process that describes its API does without

    if transfer.eyes is not Eyes.FREE:
        return [None] * request.num_frames
    view = cast("FreeView", transfer.views[name])
    if request.path is None:
        return [view.camera] * request.num_frames

    def placed(eye: CameraFrame) -> Camera:
        return placed_camera(view.name, eye.to_world, eye.yfov).camera

    if isinstance(request.path, Turntable):
        start = view.camera if request.path.start is None else placed(request.path.start)
        return turntable(start, view.bounds, request.num_frames)
    return along([placed(eye) for eye in request.path.eyes], request.num_frames)


def look_of(request: Keyframes, default: Mapping[str, Any], index: int) -> Look:
    """The look of a frame, validated: one of the batch's, or between two of them."""
    return looks.validate(document_of(request, default, index), default)


def document_of(request: Keyframes, default: Mapping[str, Any], index: int) -> Mapping[str, Any]:
    """The complete look of a frame; only those that it lies between are completed."""
    if len(request.looks) == request.num_frames:
        return looks.complete(request.looks[index], default)
    share = index / max(1, request.num_frames - 1)
    first, second, part = neighbours(len(request.looks), share)
    keys = dict.fromkeys((first, second))  # one of them where the frame is a keyframe
    return morph([looks.complete(request.looks[k], default) for k in keys], part, request.between)
