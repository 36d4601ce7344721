"""Small pictures of baked scenes, painted once by the same code and kept."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from pathlib import Path

from relume import look as looks
from relume.code_version import image_code
from relume.imageio.files import write_image
from relume.imageio.shrink import shrink
from relume.picture.transfer import Opened
from server.library.ports import Library
from server.library.threads import Threads
from server.library.transfers import TransferPool

MAX_WIDTH = 320


@dataclass(frozen=True)
class Thumbnails:
    """Files in a folder, made where it is missing."""

    folder: Path
    transfers: TransferPool
    threads: Threads
    library: Library

    async def find(self, bake: str, store: Path) -> Path:
        """The file of a ready bake's thumbnail, painted where it is missing.

        Args:
            bake: an id that the ledger knows. store: of that bake.
        """
        path = self.folder / f"{bake}-{image_code()}.webp"
        if not path.exists():
            async with self.transfers.using(bake, store) as transfer:
                await asyncio.get_running_loop().run_in_executor(self.threads.long, self._paint, transfer, path)
        return path

    def _paint(self, transfer: Opened, path: Path) -> None:
        if path.exists():  # somebody else asked at the same time
            return
        view = next(iter(transfer.views.values()))
        width = min(MAX_WIDTH, view.width)
        size = (width, max(1, round(view.height * width / view.width)))
        look = looks.validate(transfer.default_look, transfer.default_look)
        image = shrink(self.library.render_small(transfer, view.name, look, width), size)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_image(path, image, look.display.exposure, look.display.tone_map)
        bake, _, _ = path.stem.partition("-")
        for other in path.parent.glob(f"{bake}*.webp"):  # of other code
            if other != path:
                other.unlink(missing_ok=True)
