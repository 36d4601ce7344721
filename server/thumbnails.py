"""Small pictures of baked scenes, painted once and kept."""

from __future__ import annotations

import asyncio
from pathlib import Path

from relume import look as looks
from relume.imageio import write_image
from relume.shrink import shrink
from server.live.ports import Transfer
from server.services import Services

MAX_WIDTH = 320


async def thumbnail(services: Services, bake: str) -> Path:
    """The file of a ready bake's thumbnail, painted where it is missing. `bake` is an id that the ledger knows."""
    path = services.settings.data / "thumbnails" / f"{bake}.webp"
    if not path.exists():
        async with services.transfers.using(bake, services.bakes.store_path(bake)) as transfer:
            loop = asyncio.get_running_loop()
            await loop.run_in_executor(services.threads.long, _paint, services, transfer, path)
    return path


def _paint(services: Services, transfer: Transfer, path: Path) -> None:
    if path.exists():  # somebody else asked at the same time
        return
    view = next(iter(transfer.views.values()))
    width = min(MAX_WIDTH, view.width)
    size = (width, max(1, round(view.height * width / view.width)))
    look = looks.validate(transfer.default_look, transfer.default_look)
    image = shrink(services.house.library.render_small(transfer, view.name, look, width), size)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_image(path, image, look.display.exposure, look.display.tone_map)
