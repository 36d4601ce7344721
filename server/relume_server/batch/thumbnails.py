"""Thumbnails of bakes, rendered once per code version and stored."""

from __future__ import annotations

from pathlib import Path

from relume.core.source_hash import image_code
from relume_server.runtime.single_flight import SingleFlight
from relume_worker.jobs.step import RunStep, Step

NUM_WAITING = 2
"""Threads that wait for steps; more would only wait for the processes."""


class Thumbnails:
    """Files in a folder, rendered if they are missing.

    Args:
        folder: folder of the files. run: runs steps.
    """

    def __init__(self, folder: Path, run: RunStep) -> None:
        self._folder, self._run = folder, run
        self._single_flight = SingleFlight(NUM_WAITING, "relume-thumbnail")

    def close(self) -> None:
        """Stop; no step may be running."""
        self._single_flight.close()

    async def get_or_paint(self, bake: str) -> Path:
        """Return the file of a ready bake's thumbnail; renders it if missing, with priority.

        Args:
            bake: an existing id.
        """
        path = self.path(bake)
        if not path.exists():
            await self._single_flight.run(bake, lambda: self.paint(bake, is_first=True))
        return path

    def path(self, bake: str) -> Path:
        """File of a bake's thumbnail, existing or not."""
        return self._folder / f"{bake}-{image_code()}.webp"

    def paint(self, bake: str, *, is_first: bool) -> None:
        """Render the thumbnail of a ready bake. is_first: whether someone waits. Raises what `RunStep` raises."""
        path = self.path(bake)
        values = {"bake": bake, "path": str(path)}
        self._run(Step("thumbnail of a bake", is_first, values), lambda share: None, lambda: True)
        for stale in self._folder.glob(f"{bake}-*.webp"):  # of another code version
            if stale != path:
                stale.unlink(missing_ok=True)
