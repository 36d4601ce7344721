"""A local object store that counts its requests: moto, as a process, if it is installed."""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.request import Request, urlopen

from relume_bench.scaling.ledgers import tree_cpu_s


@dataclass(frozen=True)
class LocalStore:
    """A running store.

    Attributes:
        environment: variables with which relume uses it. pid: of its process. log: with a line for each request.
    """

    environment: Mapping[str, str]
    pid: int
    log: Path

    def requests(self) -> Counter[str]:
        """Requests so far by method."""
        words = self.log.read_text(errors="replace").split('"')[1::2]
        return Counter(line.split()[0] for line in words if line.endswith(("HTTP/1.1", "HTTP/1.1[0m")))

    def cpu_s(self) -> float:
        """Processor time so far, in seconds."""
        return tree_cpu_s(self.pid)


@contextmanager
def local_store(folder: Path) -> Iterator[LocalStore | None]:
    """Start a store with a bucket; None if moto is not installed. folder: of its log."""
    if importlib.util.find_spec("moto") is None:
        yield None
        return
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = int(free.getsockname()[1])
    log, url = folder / "requests.log", f"http://127.0.0.1:{port}"
    keys = {"AWS_ENDPOINT_URL": url, "AWS_REGION": "us-east-1", "AWS_ACCESS_KEY_ID": "key"}
    environment = {**keys, "AWS_SECRET_ACCESS_KEY": "secret", "RELUME_STORAGE": "s3://scaling/team"}
    with log.open("w") as stream:
        command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
        process = subprocess.Popen(command, stdout=stream, stderr=stream, env={**os.environ, "NO_COLOR": "1"})
    try:
        _make_bucket(f"{url}/scaling")
        yield LocalStore(environment, process.pid, log)
    finally:
        process.terminate()
        process.wait(30)


def _make_bucket(url: str) -> None:
    for attempt in range(300):
        try:
            urlopen(Request(url, method="PUT"), timeout=5).close()
            return
        except OSError:
            if attempt == 299:
                raise
            time.sleep(0.1)
