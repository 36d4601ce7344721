"""What steps work with: the library, and the bakes that were used last."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from relume.picture.transfer import Opened
from server.library.ports import Library
from worker.paths import bake_path


@dataclass
class Workshop:
    """Of one process."""

    data: Path
    library: Library
    _opened: dict[str, Opened] = field(default_factory=dict, init=False)

    def transfer(self, bake: str) -> Opened:
        """A bake, opened to be read; the last two stay open, of which each queue may need one. Raises StoreError."""
        if bake not in self._opened:
            for oldest in list(self._opened)[: len(self._opened) - 1]:
                del self._opened[oldest]
            self._opened[bake] = self.library.open_in_passing(bake_path(self.data, bake))
        self._opened[bake] = found = self._opened.pop(bake)
        return found
