"""What each frame of a batch shows: from where, and under which look; and from where a comparison sees its view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from relume import look as looks
from relume.errors import ParameterError
from relume.look import Look
from relume.look.morph import morph, neighbours
from relume.look.turned import with_turned_light, with_turned_sky
from relume.picture.transfer import AnyView, Eyes, Opened
from relume.scene.placed_camera import placed_camera
from server.wire.bodies import TruthRequest
from server.wire.cameras import CameraFrame
from server.wire.renders import Animation, EyePath, Keyframes, LooksRequest, Turntable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from relume.moving.transfer import MovingTransfer
    from relume.moving.view import FreeView
    from relume.scene.model import Camera


def check_animation(request: Animation, view: str, transfer: Opened) -> Sequence[Camera | None]:
    """Whether a bake can follow a batch, and where each frame is seen from; None where it was baked.

    Raises:
        ParameterError: what cannot be, and what can.
    """
    path, num = request.path, request.num_frames
    if path is not None and transfer.eyes is not Eyes.FREE and not _needs_no_eye(path):
        able = "no path, or bake by method surface: this bake is seen from where it was baked alone"
        raise ParameterError("path", _path_text(path), able)
    if isinstance(path, Turntable) and request.frames not in (None, path.turntable):
        raise ParameterError("frames", request.frames, f"{path.turntable}, as the turntable says, or nothing")
    num_eyes = 0 if path is None or isinstance(path, Turntable) else len(path.eyes)
    if num_eyes > num:
        raise ParameterError("path/eyes", f"{num_eyes} keyframes", f"at most as many as frames, {num}")
    return eyes_of(request, view, transfer)


def _path_text(path: Turntable | EyePath) -> str:
    return f"turntable {path.turntable}" if isinstance(path, Turntable) else f"{len(path.eyes)} cameras"


def _needs_no_eye(path: Turntable | EyePath) -> bool:
    return isinstance(path, Turntable) and path.turns == "environment" and path.start is None


def eyes_of(request: Animation, name: str, transfer: Opened) -> Sequence[Camera | None]:
    """Where each frame is seen from; None where it was baked. Raises ParameterError for bad cameras."""
    from relume.moving.paths import along, turntable  # SciPy, which a process that describes its API does without

    if transfer.eyes is not Eyes.FREE:
        return [None] * request.num_frames
    view = cast("FreeView", transfer.views[name])
    if request.path is None:
        return [view.camera] * request.num_frames

    if isinstance(request.path, Turntable):
        start = _start_of(request.path, view)
        if request.path.turns == "environment":
            return [start] * request.num_frames
        return turntable(start, _pivot_of(request.path, view, transfer), request.num_frames)
    return along([_placed(view, eye) for eye in request.path.eyes], request.num_frames)


def _placed(view: AnyView, eye: CameraFrame) -> Camera:
    return placed_camera(view.name, eye.to_world, eye.yfov).camera


def compared_from(request: TruthRequest, transfer: Opened) -> tuple[Camera, tuple[int, int]]:
    """From where a comparison sees its view, and how large its pictures are. Raises ParameterError for bad cameras."""
    view = transfer.views[request.view]
    camera = view.camera if request.camera is None else _placed(view, request.camera)
    return camera, request.size or (view.width, view.height)


def _start_of(path: Turntable, view: FreeView) -> Camera:
    return view.camera if path.start is None else _placed(view, path.start)


def _pivot_of(path: Turntable, view: FreeView, transfer: Opened) -> NDArray[np.float64]:
    from relume.moving.paths import looked_at

    if path.about is not None:
        return np.array(path.about)
    return looked_at(cast("MovingTransfer", transfer), _start_of(path, view))


def with_pivot(request: LooksRequest, transfer: Opened) -> LooksRequest:
    """The same where an object turns, about a place that is found once rather than for each frame."""
    path = request.path
    if request.view is None or not isinstance(path, Turntable) or path.turns != "object":
        return request
    pivot = _pivot_of(path, cast("FreeView", transfer.views[request.view]), transfer)
    return request.model_copy(update={"path": path.model_copy(update={"about": pivot.tolist()})})


def look_of(request: Animation, view: str, transfer: Opened, index: int) -> Look:
    """The look of a frame, validated: one of the batch's, or between two of them, under light that `path` may turn."""
    default = transfer.default_look
    return looks.validate(document_of(request, view, transfer, index), default)


def document_of(request: Animation, view: str | None, transfer: Opened, index: int) -> Mapping[str, Any]:
    """The complete look of a frame, see `look_of`; `view` may be None where there is no path."""
    document = _key_or_between(request, transfer.default_look, index)
    if not isinstance(request.path, Turntable) or request.path.turns == "eye":
        return document
    degrees = 360 * index / request.num_frames
    if request.path.turns == "environment":
        return with_turned_sky(document, degrees)
    pivot = _pivot_of(request.path, cast("FreeView", transfer.views[cast("str", view)]), transfer)
    return with_turned_light(document, degrees, pivot.tolist())


def _key_or_between(request: Keyframes, default: Mapping[str, Any], index: int) -> Mapping[str, Any]:
    """Only those looks that a frame lies between are completed."""
    if len(request.looks) == request.num_frames:
        return looks.complete(request.looks[index], default)
    share = index / max(1, request.num_frames - 1)
    first, second, part = neighbours(len(request.looks), share)
    keys = dict.fromkeys((first, second))  # one of them where the frame is a keyframe
    return morph([looks.complete(request.looks[k], default) for k in keys], part, request.between)
