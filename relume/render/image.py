"""One picture without a session: batch renders, `relume render`, thumbnails."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from relume.errors import PlanError
from relume.look import Look
from relume.methods.moving_views import MovingViews
from relume.methods.stills import Stills
from relume.moving.picture import MovingPicture
from relume.moving.rest.still_jobs import ExactView
from relume.picture.finish import finish
from relume.picture.jobs import Cancelled, Progress
from relume.picture.picture import Picture
from relume.picture.transfer import Opened, Transfer
from relume.scene.model import Camera


def render_image(
    transfer: Opened,
    view_name: str,
    look: Look,
    size: tuple[int, int] | None = None,
    progress: Progress = lambda share: None,
    cancelled: Cancelled = lambda: False,
    *,
    for_display: bool = False,
    eye: tuple[Camera, tuple[int, int]] | None = None,
    stills: Stills | None = None,
) -> NDArray[np.float32]:
    """Render a look exactly; what is made for it is kept in passing in the memory that the bake was opened with.

    Args:
        transfer: an opened bake. view_name: one of its views.
        size: width and height; None means the baked one, and none else is possible where the view is fixed.
        progress: called with about the share done. cancelled: asked now and then.
        for_display: coverage is for laying it over display values, as PNG and WebP are; see `Backdrop.alpha`.
        eye: of a bake whose eyes move: another camera than the view's, and the size of its picture.
        stills: of such a bake: makes the picture exact; None: it is as true as the picture that moves.
    Returns:
        Linear radiance; where the look's background is transparent, coverage as a fourth channel, which the others
        are multiplied by already. (height, width, 3 or 4) float32
    Raises:
        PlanError: another size than the baked one.
        CancelledError: `cancelled` said so.
    """
    view = transfer.views[view_name]
    if isinstance(transfer, MovingViews):
        eye = eye or (view.camera, size or (view.width, view.height))
        if stills is None:
            return _pixels(_moving(transfer, view_name, look, eye), for_display)
        memory = transfer.memory.passing
        exact = ExactView(stills.make, memory, eye, look, None).picture(progress, cancelled)
        return _pixels(exact, for_display)
    if size is not None and tuple(size) != (view.width, view.height):
        raise PlanError(f"the bake is {view.width}×{view.height}, not {size[0]}×{size[1]}; bake that size")
    picture = Picture(cast("Transfer", transfer), view_name, transfer.memory.passing)
    picture.set_look(look)
    finish(picture, look, progress, cancelled)
    return _pixels(picture, for_display)


def _pixels(picture: Picture | MovingPicture, for_display: bool) -> NDArray[np.float32]:
    image, alpha = picture.image(), picture.alpha(for_display=for_display)
    return image if alpha is None else np.dstack([image, alpha])


def render_small(transfer: Opened, view_name: str, look: Look, width: int) -> NDArray[np.float32]:
    """Render a look at no more pixels than a small picture needs: whole steps of the baked ones are left out.

    Args:
        transfer: an opened bake. view_name: one of its views.
        width: of the small picture.
    Returns:
        Linear radiance, at least `width` wide where the bake is. (h, w, 3) float32
    """
    view = transfer.views[view_name]
    step = max(1, view.width // width)
    if isinstance(transfer, MovingViews):
        small = view.width // step, max(1, view.height // step)
        return _moving(transfer, view_name, look, (view.camera, small)).image()
    return render_image(transfer if step < 2 else cast("Transfer", transfer).thinned(view_name, step), view_name, look)


def _moving(transfer: MovingViews, view_name: str, look: Look, eye: tuple[Camera, tuple[int, int]]) -> MovingPicture:
    """What is seen while the eye moves."""
    picture = MovingPicture(transfer, view_name)
    picture.set_look(look)
    picture.set_eye(*eye)
    picture.advance(None)
    return picture
