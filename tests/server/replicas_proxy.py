"""nginx with docker/replicas/nginx.conf in front of test servers."""

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

CONFIGURATION = Path(__file__).parents[2] / "docker" / "replicas" / "nginx.conf"
_NGINX = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")


@contextmanager
def proxy_to_ports(folder: Path, ports: Sequence[int]) -> Iterator[int]:
    """Port of nginx in front of servers at local ports; skips the test if nginx is not installed.

    Args:
        folder: for its files.
    """
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with _running(folder, port, [f"127.0.0.1:{each}" for each in ports]):
        yield port


@contextmanager
def proxy_to_shared_name(folder: Path, addresses: Sequence[str], server_port: int) -> Iterator[int]:
    """As `proxy_to_ports`, for servers at several addresses of the name `server`, as in Compose."""
    (folder / "hosts").write_text("".join(f"{address} server\n" for address in addresses))
    private_mounts = ["unshare", "--map-root-user", "--mount"]  # only this nginx resolves the name to these addresses
    if shutil.which("unshare") is None or subprocess.run([*private_mounts, "true"], check=False).returncode != 0:
        pytest.skip("unshare may not give a process mounts of its own here")
    mount_script = 'mount --bind "$0" /etc/hosts && exec "$@"'
    command_prefix = [*private_mounts, "sh", "-c", mount_script, str(folder / "hosts")]
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with _running(folder, port, [f"server:{server_port}"], command_prefix):
        yield port


@contextmanager
def _running(folder: Path, port: int, servers: Sequence[str], command_prefix: Sequence[str] = ()) -> Iterator[None]:
    """nginx at a port until the context ends; `command_prefix` precedes its command."""
    text = CONFIGURATION.read_text().replace("/tmp/", f"{folder}/")
    text = text.replace("listen 8420", f"listen 127.0.0.1:{port}")
    (line,) = re.findall(r"server server:8420[^;]*;", text)
    lines = "".join(line.replace("server:8420", each) for each in servers)
    with running_nginx(folder, port, text.replace(line, lines), command_prefix):
        yield


@contextmanager
def running_nginx(folder: Path, port: int, text: str, command_prefix: Sequence[str] = ()) -> Iterator[None]:
    """nginx with a configuration that listens at a port, until the context ends; skips the test without nginx."""
    if _NGINX is None:
        pytest.skip("nginx is not installed (Debian: apt-get install nginx-light)")
    (folder / "nginx.conf").write_text(text)
    # root in the namespace is the current user and cannot become another
    directives = "daemon off;" + (" user root;" if command_prefix else "")
    command = [*command_prefix, _NGINX, "-p", str(folder), "-c", str(folder / "nginx.conf"), "-g", directives]
    process = subprocess.Popen(command)
    try:
        _wait_for(port, process)
        yield
    finally:
        process.terminate()
        process.wait()


def _wait_for(port: int, process: subprocess.Popen[bytes]) -> None:
    while process.poll() is None:
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=1).close()
        except OSError:
            time.sleep(0.02)
    raise RuntimeError("nginx does not start; its words are above")
