"""nginx with docker/replicas/nginx.conf, before servers of a test."""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

_CONFIGURATION = Path(__file__).parents[2] / "docker" / "replicas" / "nginx.conf"
_NGINX = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")


@contextmanager
def proxied(folder: Path, ports: Sequence[int]) -> Iterator[int]:
    """Port of nginx before servers at ports of this machine; skips the test where there is no nginx.

    Args:
        folder: for its files.
    """
    if _NGINX is None:
        pytest.skip("nginx is not installed (Debian: apt-get install nginx-light)")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    text = _CONFIGURATION.read_text().replace("/tmp/", f"{folder}/")
    text = text.replace("listen 8420", f"listen 127.0.0.1:{port}")
    (line,) = re.findall(r"server server:8420[^;]*;", text)
    lines = "".join(line.replace("server:8420", f"127.0.0.1:{each}") for each in ports)
    (folder / "nginx.conf").write_text(text.replace(line, lines))
    process = subprocess.Popen([_NGINX, "-p", str(folder), "-c", str(folder / "nginx.conf"), "-g", "daemon off;"])
    try:
        _wait_for(port)
        yield port
    finally:
        process.terminate()
        process.wait()


def _wait_for(port: int) -> None:
    while True:
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=1).close()
        except OSError:
            time.sleep(0.02)
