"""Rendering of single images without a session: batch renders, `relume render`, thumbnails."""

from __future__ import annotations

from typing import cast

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import PlanError
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.live.fixed_camera.picture import Picture, render_exact
from relume.live.fixed_camera.protocols import FixedViewTransfer, OpenBake
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.static_view_jobs import StaticViewState
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.live.opened.static_view import StaticViewBuilder
from relume.look import Look
from relume.look.glass import glass_of
from relume.scene.model import Camera
from relume.views.downsampled import downsampled_size


def render_image(
    transfer: OpenBake,
    view_name: str,
    look: Look,
    size: tuple[int, int] | None = None,
    progress: ProgressCallback = lambda share: None,
    is_canceled: CancelCheck = lambda: False,
    *,
    for_display: bool = False,
    camera_and_size: tuple[Camera, tuple[int, int]] | None = None,
    static_views: StaticViewBuilder | None = None,
) -> Shaped[NDArray[np.float32], "height width channels"]:
    """Render a look exactly; intermediate results are transient entries of the cache of the bake.

    Args:
        transfer: an opened bake. view_name: one of its views. look: the look.
        size: width and height; None means the baked size, the only one possible for a fixed camera.
        progress: called with the approximate finished fraction. is_canceled: called regularly.
        for_display: coverage is for compositing of display values, as in PNG and WebP.
        camera_and_size: for a bake with a free camera, another camera than the view's, and the size of the image.
        static_views: for such a bake, static views that make the image exact; None: the image is the free-camera image.
            Looks with edited glass need them with any bake, see `needs_tracing`.
    Returns:
        Linear radiance; for a transparent background, coverage as a fourth channel, with premultiplied color.
    Raises:
        PlanError: the size differs from the baked one.
        CancelledError: `is_canceled` returned true.
        ResultUnavailableError: the look edits glass, and there are no static views.
    """
    view = transfer.views[view_name]
    baked_size = view.width, view.height
    if not isinstance(transfer, BakedFreeCamera):
        camera_and_size = view.camera, baked_size
        if size is not None and tuple(size) != baked_size:
            raise PlanError(f"the bake is {view.width}×{view.height}, not {size[0]}×{size[1]}; bake that size")
    camera_and_size = camera_and_size or (view.camera, size or baked_size)
    if static_views is not None and needs_tracing(transfer, look):
        cache = transfer.cache.transient
        exact = StaticViewState(static_views.make_static_view, cache, camera_and_size, look, None).static_picture(
            progress, is_canceled
        )
        return _pixels(exact, for_display)
    if isinstance(transfer, BakedFreeCamera):
        return _pixels(_render_free_camera(transfer, view_name, look, camera_and_size), for_display)
    picture = Picture(cast("FixedViewTransfer", transfer), view_name, transfer.cache.transient)
    picture.set_look(look)
    render_exact(picture, look, progress, is_canceled)
    return _pixels(picture, for_display)


def needs_tracing(transfer: OpenBake, look: Look) -> bool:
    """Return whether the exact image of a look needs rays that the bake has not traced."""
    return isinstance(transfer, BakedFreeCamera) or glass_of(look) != transfer.glass


def _pixels(picture: Picture | FreeCameraPicture, for_display: bool) -> NDArray[np.float32]:
    image, alpha = picture.image(), picture.alpha(for_display=for_display)
    return image if alpha is None else np.dstack([image, alpha])


def render_small(
    transfer: OpenBake,
    view_name: str,
    look: Look,
    width: int,
    camera_and_size: tuple[Camera, tuple[int, int]] | None = None,
) -> Shaped[NDArray[np.float32], "h w channels"]:
    """Render a look with only as many pixels as a small image needs, a whole fraction of the baked ones.

    Args:
        transfer: an opened bake. view_name: one of its views. look: the look.
        width: width of the small image. camera_and_size: as for `render_image`; the size of the large image.
    Returns:
        Linear radiance, at least `width` wide if the bake is.
    """
    view = transfer.views[view_name]
    if isinstance(transfer, BakedFreeCamera):
        camera = view.camera if camera_and_size is None else camera_and_size[0]
        size = small_size(transfer, view_name, width, camera_and_size)
        return _render_free_camera(transfer, view_name, look, (camera, size)).image()
    step = max(1, view.width // width)
    return render_image(
        transfer if step < 2 else cast("FixedViewTransfer", transfer).downsampled(view_name, step), view_name, look
    )


def small_size(
    transfer: OpenBake, view_name: str, width: int, camera_and_size: tuple[Camera, tuple[int, int]] | None = None
) -> tuple[int, int]:
    """Return the width and height of the image of `render_small`, without rendering it.

    Args:
        transfer, view_name, width, camera_and_size: as for `render_small`.
    """
    view = transfer.views[view_name]
    large_width, large_height = (view.width, view.height) if camera_and_size is None else camera_and_size[1]
    step = max(1, large_width // width)
    if isinstance(transfer, BakedFreeCamera):
        return large_width // step, max(1, large_height // step)
    return downsampled_size((large_width, large_height), step)


def _render_free_camera(
    transfer: BakedFreeCamera, view_name: str, look: Look, camera_and_size: tuple[Camera, tuple[int, int]]
) -> FreeCameraPicture:
    """Render the free-camera image."""
    picture = FreeCameraPicture(transfer, view_name)
    picture.set_look(look)
    picture.set_camera(*camera_and_size)
    picture.advance(None)
    return picture
