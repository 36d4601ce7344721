"""The server of a soak test, its resources and its child processes."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from relume.core.folder_size import folder_bytes
from relume.core.memory_usage import resident_bytes

START_S, STOP_S, ANSWER_S = 120.0, 90.0, 60.0
SETTINGS = {
    "RELUME_IDLE_SECONDS": "10",
    "RELUME_CACHE_BYTES": str(256 << 20),
    "RELUME_RECONNECT_SECONDS": "1",
    "RELUME_RESUME_SECONDS": "10",
    "RELUME_AUDIT_LINES": "500",
}
"""Small limits, so that leaks are visible in minutes."""


@dataclass(frozen=True)
class Sample:
    """Resources of the server at one moment; `at_s` since the start.

    Attributes:
        memory_bytes: resident bytes of its process. workers: resident bytes of its child processes.
        handles: open files and sockets. threads: threads of its process. disk: bytes in the data directory.
    """

    at_s: float
    memory_bytes: int
    workers: int
    handles: int
    threads: int
    disk: int


class SoakServer:
    """`relume serve` on a folder of its own."""

    def __init__(self, data: Path) -> None:
        self.data = data
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = int(free.getsockname()[1])
        command = [sys.executable, "-m", "relume_cli.main", "serve", "--data", str(data), "--port", str(self.port)]
        with (data / "server.log").open("ab") as log:
            self._process = subprocess.Popen(command, stderr=log, env=os.environ | SETTINGS)
        self._wait()

    def _wait(self) -> None:
        deadline = time.monotonic() + START_S
        while True:
            try:
                self.call("/readyz")
                return
            except OSError:
                if self._process.poll() is not None or time.monotonic() > deadline:
                    raise RuntimeError(f"the server did not start: {self.log[-500:]}") from None
                time.sleep(0.2)

    @property
    def log(self) -> str:
        """Log so far."""
        return (self.data / "server.log").read_text()

    @property
    def is_alive(self) -> bool:
        """True if its process runs."""
        return self._process.poll() is None

    def call(self, path: str, body: Any = None, method: str | None = None) -> Any:
        """Call REST at `path` and return the JSON; the default `method` is GET, or POST with a body.

        Raises:
            OSError: the call is refused.
        """
        data = None if body is None else json.dumps(body).encode()
        url = f"http://127.0.0.1:{self.port}{path}"
        request = urllib.request.Request(url, data, {"Content-Type": "application/json"}, method=method)
        with urllib.request.urlopen(request, timeout=ANSWER_S) as answer:
            text = answer.read()
        return json.loads(text) if text[:1] in (b"{", b"[") else None

    def sample(self, at_s: float) -> Sample:
        """Take a sample."""
        proc = Path(f"/proc/{self._process.pid}")
        workers = sum(resident_bytes(pid) for pid in self.children())
        handles, threads = (len(list((proc / name).iterdir())) for name in ("fd", "task"))
        return Sample(at_s, resident_bytes(self._process.pid), workers, handles, threads, folder_bytes(self.data))

    def children(self) -> list[int]:
        """Process ids of its descendants, but for Python's tracker of semaphores.

        If that one is killed, its successor reports each semaphore of before as an error when it is released.
        """
        parents: dict[int, int] = {}
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                with suppress(OSError, IndexError):
                    if b"resource_tracker" in (entry / "cmdline").read_bytes():
                        continue
                    parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
        children, todo = [], [self._process.pid]
        while todo:
            status = todo.pop()
            below = [pid for pid, parent in parents.items() if parent == status]
            children += below
            todo += below
        return children

    def stop(self) -> bool:
        """Stop it cleanly; true if it stopped in time."""
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return False
        return True
