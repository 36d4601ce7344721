"""Context of steps: the library, and recently used bakes."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from pathlib import Path

from relume.live.fixed_camera.protocols import OpenBake
from relume_server.runtime.protocols import Library
from relume_worker.paths import bake_path


@dataclass
class BatchContext:
    """Context of one process. Thread-safe.

    Attributes:
        data: data directory.
        import_limits: bytes and seconds of sandboxed readers.
    """

    data: Path
    library: Library
    import_limits: tuple[int, int]
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False)
    _open_bakes: dict[str, OpenBake] = field(default_factory=dict, init=False)

    def transfer(self, bake: str) -> OpenBake:
        """Open a bake for reading; the last two stay open, because jobs take turns. Raises StoreError."""
        with self._lock:
            if bake not in self._open_bakes:
                for oldest in list(self._open_bakes)[: len(self._open_bakes) - 1]:
                    del self._open_bakes[oldest]
                self._open_bakes[bake] = self.library.open_transient(bake_path(self.data, bake))
            self._open_bakes[bake] = transfer = self._open_bakes.pop(bake)
            return transfer
