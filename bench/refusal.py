"""import.refusal_ms: from a tiny bad file to the sentence that refuses it, by a process that waits for files.

`cold_ms` is the same where no process waits, `ratio` the two; medians of a few, in turn.
"""

from __future__ import annotations

import tempfile
import time
from contextlib import closing, suppress
from pathlib import Path

import numpy as np

from bench.figure import Figure
from relume.errors import SceneError
from relume.resident import resident_bytes
from server.files.importers import Importers
from server.files.importing import ImportRequest

_WAIT_S = 2.0  # a process that waits holds no more than that long ago


def measure(tiny: bool) -> list[Figure]:
    """Refuse a file that is none."""
    found: dict[int, list[float]] = {0: [], 1: []}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene"
        file.write_bytes(b"no scene")
        request = ImportRequest(
            folder, f"sqlite:///{folder}/relume.db", "scene", str(file), None, "Bad", 60, 8 << 30, scene="bad.glb"
        )
        for _ in range(1 if tiny else 5):
            for num_waiting, times in found.items():
                with closing(Importers(num_waiting)) as importers:
                    importers.start()
                    if not tiny:
                        _wait_until_loaded(importers)
                    began = time.perf_counter()
                    with suppress(SceneError):
                        importers.run(request)
                    times.append(1e3 * (time.perf_counter() - began))
    cold, warm = (float(np.median(found[k])) for k in (0, 1))
    return [Figure("import.refusal_ms", warm, "ms", {"cold_ms": cold, "ratio": warm / cold})]


def _wait_until_loaded(importers: Importers) -> None:
    """Until those that wait have loaded what they need, which takes long on a busy machine."""
    before, held = -1, 0
    while held != before:
        time.sleep(_WAIT_S)
        before, held = held, sum(resident_bytes(process.pid) for process in importers._waiting)
