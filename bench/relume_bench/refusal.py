"""import.refusal_ms: from a tiny invalid file to its error, after an earlier import.

`cold_ms` is for the first import, before anything is loaded, `ratio` of the two; medians of a few.
"""

from __future__ import annotations

import tempfile
import time
from contextlib import closing, suppress
from pathlib import Path

import numpy as np

from relume.core.errors import SceneError
from relume_bench.figure import Figure
from relume_server.io.import_processes import Importers
from relume_server.io.import_request import ImportRequest


def measure(tiny: bool) -> list[Figure]:
    """Import an invalid file."""
    cold: list[float] = []
    warm: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene"
        file.write_bytes(b"no scene")
        into = Path(folder) / "made"
        into.mkdir()
        request = ImportRequest(
            str(into), "scene", str(file), None, "Bad", 60, 8 << 30, max_file_bytes=1 << 30, scene="bad.glb"
        )
        for _ in range(1 if tiny else 5):
            with closing(Importers()) as importers:
                for times in (cold, warm, warm, warm):
                    start_time = time.perf_counter()
                    with suppress(SceneError):
                        importers.run(request)
                    times.append(1e3 * (time.perf_counter() - start_time))
    cold_ms, warm_ms = float(np.median(cold)), float(np.median(warm))
    return [Figure("import.refusal_ms", warm_ms, "ms", {"cold_ms": cold_ms, "ratio": warm_ms / cold_ms})]
