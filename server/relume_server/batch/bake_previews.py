"""First images of bakes: rendered in advance, and thumbnails for lists."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from relume import look as looks
from relume.image_io.downsample import downsample
from relume.image_io.write_image import write_image
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume_server.batch.context import BatchContext

MAX_WIDTH = 320


def render_first(
    context: BatchContext, report: ProgressCallback, is_canceled: CancelCheck, *, bake: str
) -> Mapping[str, Any]:
    """Shade the default look in every view of a fixed-camera bake; term images are stored next to the store."""
    transfer = context.transfer(bake)
    look, num_views = looks.validate(transfer.default_look, transfer.default_look), len(transfer.views)
    for done, view in enumerate(transfer.views):

        def report_view(fraction: float, done: int = done) -> None:
            report((done + fraction) / num_views)

        context.library.render(transfer, view, look, progress=report_view, is_canceled=is_canceled)
    return {}


def paint_thumbnail(
    context: BatchContext, report: ProgressCallback, is_canceled: CancelCheck, *, bake: str, path: str
) -> Mapping[str, Any]:
    """Render the thumbnail of a bake's first view.

    Args:
        context: context of the process. report, is_canceled: callbacks. bake: id.
        path: path of the file, which appears when it is complete; an existing one is kept.
    """
    file = Path(path)
    if file.exists():  # another request was faster
        return {}
    transfer = context.transfer(bake)
    view = next(iter(transfer.views.values()))
    width = min(MAX_WIDTH, view.width)
    size = (width, max(1, round(view.height * width / view.width)))
    look = looks.validate(transfer.default_look, transfer.default_look)
    image = downsample(context.library.render_small(transfer, view.name, look, width), size)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_image(file, image, look.display.transform)
    return {}
