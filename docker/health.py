"""Health of a container: exit 0 where its role does its work. `python health.py server|worker|scheduler`"""

from __future__ import annotations

import os
import socket
import sys
import urllib.request
from pathlib import Path
from urllib.parse import urlsplit

TIMEOUT_S = 5.0
SCHEDULER_PORT = 8786


def server() -> None:
    """The server answers /readyz with 200; raises OSError where it does not."""
    with urllib.request.urlopen("http://127.0.0.1:8420/readyz", timeout=TIMEOUT_S) as answer:
        answer.read()


def scheduler() -> None:
    """The scheduler accepts connections; raises OSError where it does not."""
    socket.create_connection(("127.0.0.1", SCHEDULER_PORT), timeout=TIMEOUT_S).close()


def worker() -> None:
    """The worker holds an open connection to the scheduler; raises OSError where it does not."""
    port = urlsplit(os.environ["RELUME_SCHEDULER"]).port or SCHEDULER_PORT
    if not any(_connected_to(port, table) for table in ("/proc/net/tcp", "/proc/net/tcp6")):
        raise ConnectionError("no connection to the scheduler is open")


def _connected_to(port: int, table: str) -> bool:
    """Whether a kernel table of TCP connections holds an established one to that remote port."""
    established = "01"
    rows = [line.split() for line in Path(table).read_text(encoding="ascii").splitlines()[1:]]
    return any(row[3] == established and int(row[2].rsplit(":", 1)[1], 16) == port for row in rows)


if __name__ == "__main__":
    try:
        {"server": server, "worker": worker, "scheduler": scheduler}[sys.argv[1]]()
    except OSError as problem:
        sys.exit(f"{sys.argv[1]} is not healthy: {problem}")
