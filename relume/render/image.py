"""One picture without a session: batch renders, `relume render`, thumbnails."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
from numpy.typing import NDArray

from relume.errors import PlanError
from relume.look import Look
from relume.methods.moving_views import MovingViews
from relume.moving.picture import MovingPicture
from relume.picture.finish import finish
from relume.picture.picture import Picture
from relume.picture.transfer import Opened, Transfer


def render_image(
    transfer: Opened,
    view_name: str,
    look: Look,
    size: tuple[int, int] | None = None,
    progress: Callable[[float], object] = lambda share: None,
    cancelled: Callable[[], bool] = lambda: False,
    *,
    for_display: bool = False,
) -> NDArray[np.float32]:
    """Render a look exactly; what is made for it is kept in passing in the memory that the bake was opened with.

    Where the bake's eyes move it is as true as the picture from there is.

    Args:
        transfer: an opened bake. view_name: one of its views.
        size: width and height; None means the baked one, and none else is possible where the view is fixed.
        progress: called with about the share done. cancelled: asked now and then.
        for_display: coverage is for laying it over display values, as PNG and WebP are; see `Backdrop.alpha`.
    Returns:
        Linear radiance; where the look's background is transparent, coverage as a fourth channel, which the others
        are multiplied by already. (height, width, 3 or 4) float32
    Raises:
        PlanError: another size than the baked one.
        CancelledError: `cancelled` said so.
    """
    if isinstance(transfer, MovingViews):
        return _moving_image(transfer, view_name, look, size)
    fixed = cast("Transfer", transfer)
    view = fixed.views[view_name]
    if size is not None and tuple(size) != (view.width, view.height):
        raise PlanError(f"the bake is {view.width}×{view.height}, not {size[0]}×{size[1]}; bake that size")
    picture = Picture(fixed, view_name, fixed.memory.passing)
    picture.set_look(look)
    finish(picture, look, progress, cancelled)
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
        return _moving_image(transfer, view_name, look, (view.width // step, max(1, view.height // step)))
    return render_image(transfer if step < 2 else cast("Transfer", transfer).thinned(view_name, step), view_name, look)


def _moving_image(
    transfer: MovingViews, view_name: str, look: Look, size: tuple[int, int] | None
) -> NDArray[np.float32]:
    """What is seen from where the eye of a view begins. (height, width, 3) float32"""
    picture = MovingPicture(transfer, view_name)
    picture.set_look(look)
    if size is not None:
        picture.set_eye(transfer.views[view_name].camera, size)
    picture.advance(None)
    return picture.image()
