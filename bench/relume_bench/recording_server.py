"""The server, recording each latency in addition to the metric: `python -m relume_bench.recording_server FILE`.

The server observes "edit received → frame sent" for its metric relume_edit_to_socket_seconds: from receiving the
message to the return of the call that passes the frame to the WebSocket.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import relume_server.app
from relume_server.settings import Settings
from relume_server.telemetry.metrics import Metrics


class _Recorder:
    """Wraps a histogram."""

    def __init__(self, histogram: Any, path: Path) -> None:
        self._histogram, self._file = histogram, path.open("w")

    def observe(self, value: float) -> None:
        """Observe the value, and write it in milliseconds."""
        self._histogram.observe(value)
        self._file.write(json.dumps(1e3 * value) + "\n")
        self._file.flush()


class RecordingMetrics(Metrics):
    """Metrics that record the edits."""

    def __init__(self) -> None:
        super().__init__()
        self.edit_to_socket: Any = _Recorder(self.edit_to_socket, Path(sys.argv[1]))


if __name__ == "__main__":
    relume_server.app.Metrics = RecordingMetrics  # type: ignore[attr-defined]
    relume_server.app.serve(Settings())
