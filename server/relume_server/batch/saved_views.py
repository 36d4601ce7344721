"""Views of a batch whose looks have their own."""

from __future__ import annotations

from collections.abc import Sequence

from relume.core.errors import Description, ParameterError
from relume.core.validation import names_text
from relume.live.fixed_camera.protocols import CameraMode, OpenBake
from relume_server.persistence.look_store import LookStore
from relume_server.schemas.cameras import CameraFrame, LookView
from relume_server.schemas.renders import CameraPath, QueuedRender


def read_saved_views(request: QueuedRender, store: LookStore) -> list[str | None]:
    """Views saved with the looks of a batch, JSON; None for looks without one."""
    num_own = len(request.looks) - len(request.saved_looks)
    return [None] * num_own + [store.get(name).view for name in request.saved_looks]


def use_saved_views(request: QueuedRender, saved_views: Sequence[str | None], transfer: OpenBake) -> None:
    """Set the view of each look: that saved with it, otherwise `view`; a free camera gets the saved poses, too.

    Args:
        request: with names of all looks. saved_views: view of each look, JSON; None: none. transfer: the bake.
    Raises:
        ParameterError: looks have no view, one that is not in the bake, or a pose that fixed cameras do not have. All
            of these looks are named.
    """
    views = [_view(text, request.view) for text in saved_views]
    _check_views(request.look_names, views, transfer)
    request.look_views = [view.view for view in views if view is not None]
    if transfer.camera_mode is CameraMode.FREE:
        cameras = [view.camera or _baked_camera(view.view, transfer) for view in views if view is not None]
        request.path = CameraPath(cameras=cameras)


def _view(text: str | None, default: str | None) -> LookView | None:
    if text is not None:
        return LookView.model_validate_json(text)
    return None if default is None else LookView(view=default)


def _baked_camera(view: str, transfer: OpenBake) -> CameraFrame:
    return CameraFrame.from_camera(transfer.views[view].camera)


def _check_views(names: list[str], views: list[LookView | None], transfer: OpenBake) -> None:
    named = list(zip(names, views, strict=True))
    if missing := [name for name, view in named if view is None]:
        raise ParameterError("/view", None, f"a view for the looks that are saved without one: {names_text(missing)}")
    if unknown := [f"{name}: {view.view}" for name, view in named if view and view.view not in transfer.views]:
        value = Description(f"views that the bake does not have ({names_text(unknown)})")
        raise ParameterError("/saved_looks", value, "looks with a view of the bake: " + ", ".join(transfer.views)[:400])
    has_fixed_cameras = transfer.camera_mode is not CameraMode.FREE
    if has_fixed_cameras and (moved := [name for name, view in named if view and view.camera is not None]):
        value = Description(f"looks with a free camera ({names_text(moved)})")
        raise ParameterError("/saved_looks", value, "looks with a fixed camera, or a bake of method probes")
