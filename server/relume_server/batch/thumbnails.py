"""Small pictures of baked scenes, painted once by the same code and kept."""

from __future__ import annotations

from pathlib import Path

from relume.core.source_hash import image_code
from relume_server.batch.step import RunStep, Step
from relume_server.runtime.single_flight import SingleFlight

NUM_WAITING = 2
"""Threads that wait for steps: others have to wait for their turn there anyway."""


class Thumbnails:
    """Files in a folder, made where they are missing.

    Args:
        run: does steps.
    """

    def __init__(self, folder: Path, run: RunStep) -> None:
        self._folder, self._run = folder, run
        self._single_flight = SingleFlight(NUM_WAITING, "relume-thumbnail")

    def close(self) -> None:
        """Paint no more; no step may be under way that is not ended."""
        self._single_flight.close()

    async def get_or_paint(self, bake: str) -> Path:
        """The file of a ready bake's thumbnail, painted where it is missing; somebody waits for it.

        Args:
            bake: an id that the ledger knows.
        """
        path = self.path(bake)
        if not path.exists():
            await self._single_flight.run(bake, lambda: self.paint(bake, is_first=True))
        return path

    def path(self, bake: str) -> Path:
        """Where the thumbnail of a bake is, or will be."""
        return self._folder / f"{bake}-{image_code()}.webp"

    def paint(self, bake: str, *, is_first: bool) -> None:
        """Paint the thumbnail of a ready bake. is_first: whether somebody waits. Raises what `RunStep` does."""
        path = self.path(bake)
        values = {"bake": bake, "path": str(path)}
        self._run(Step("thumbnail of a bake", is_first, values), lambda share: None, lambda: True)
        for stale in self._folder.glob(f"{bake}-*.webp"):  # of other code
            if stale != path:
                stale.unlink(missing_ok=True)
