"""What bakes show before anybody edits them: made ahead of the first who opens them, and small for lists."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from relume import look as looks
from relume.imageio.files import write_image
from relume.imageio.shrink import shrink
from relume.picture.jobs import Cancelled, Progress
from server.apart.workshop import Workshop

MAX_WIDTH = 320


def shade(shop: Workshop, tell: Progress, cancelled: Cancelled, *, bake: str) -> Mapping[str, Any]:
    """Shade the scene's own look in every view of a bake of fixed views; its images stay beside the store, where an
    opened picture looks for them."""
    transfer = shop.transfer(bake)
    look, num_views = looks.validate(transfer.default_look, transfer.default_look), len(transfer.views)
    for done, view in enumerate(transfer.views):

        def tell_view(share: float, done: int = done) -> None:
            tell((done + share) / num_views)

        shop.library.render(transfer, view, look, progress=tell_view, cancelled=cancelled)
    return {}


def paint_thumbnail(shop: Workshop, tell: Progress, cancelled: Cancelled, *, bake: str, path: str) -> Mapping[str, Any]:
    """Paint the first view of a bake small.

    Args:
        path: of the file, which appears whole; what is there already stays.
    """
    file = Path(path)
    if file.exists():  # somebody else asked at the same time
        return {}
    transfer = shop.transfer(bake)
    view = next(iter(transfer.views.values()))
    width = min(MAX_WIDTH, view.width)
    size = (width, max(1, round(view.height * width / view.width)))
    look = looks.validate(transfer.default_look, transfer.default_look)
    image = shrink(shop.library.render_small(transfer, view.name, look, width), size)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_image(file, image, look.display.exposure, look.display.tone_map)
    return {}
