"""Small pictures of baked scenes, painted once by the same code and kept."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from pathlib import Path

from relume.code_version import image_code
from server.apart.step import RunStep, Step


@dataclass(frozen=True)
class Thumbnails:
    """Files in a folder, made where they are missing.

    Attributes:
        run: does steps.
    """

    folder: Path
    run: RunStep

    async def find(self, bake: str) -> Path:
        """The file of a ready bake's thumbnail, painted where it is missing; somebody waits for it.

        Args:
            bake: an id that the ledger knows.
        """
        path = self.path(bake)
        if not path.exists():
            await asyncio.to_thread(self.paint, bake, is_first=True)
        return path

    def path(self, bake: str) -> Path:
        """Where the thumbnail of a bake is, or will be."""
        return self.folder / f"{bake}-{image_code()}.webp"

    def paint(self, bake: str, *, is_first: bool) -> None:
        """Paint the thumbnail of a ready bake. is_first: whether somebody waits. Raises what `RunStep` does."""
        path = self.path(bake)
        values = {"bake": bake, "path": str(path)}
        self.run(Step("thumbnail of a bake", is_first, values), lambda share: None, lambda: True)
        for other in self.folder.glob(f"{bake}-*.webp"):  # of other code
            if other != path:
                other.unlink(missing_ok=True)
