"""slow_readers.mb: growth of a server's memory with clients that request a large response and do not read it.

A real server on a free-camera bake. Many connections request the same array, the largest of the bake, and read nothing;
the figure is the resident memory of the server's process when all wait, minus that after as many have read the same
response completely at the same time. `answer_mb` is the size of the response.
"""

from __future__ import annotations

import json
import socket
import time
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

from relume.core.memory_usage import resident_bytes
from relume.scene.examples.catalog import built_in
from relume.store.bake_protocol import Recipe
from relume_bench.baked_server import BakedFolder, Server, baked_folder, serving
from relume_bench.figure import Figure

_NAME = "slow_readers.mb"
_NUM_STABLE_READINGS = 5
"""Number of consecutive readings without growth."""


def measure(tiny: bool) -> list[Figure]:
    """Bake, serve, request."""
    readers, num_probes = (3, 2_000) if tiny else (60, 200_000)
    scene = built_in("cornell_box")
    recipe = Recipe("probes", (scene.cameras[0].name,), (64, 64), 60, num_probes=num_probes)
    with baked_folder(scene, recipe) as data_folder, serving(data_folder, {"RELUME_PREWARM": "false"}) as server:
        array, answer_bytes = _largest(server, data_folder)
        with ThreadPoolExecutor(readers) as threads:
            list(threads.map(lambda _: _read(server, array), range(readers)))
        before = _measure_settled_bytes(server)
        with ExitStack() as connections:
            for _ in range(readers):
                _ask(connections, server, array)
            idle_bytes = _measure_settled_bytes(server)
    context = {"readers": readers, "answer_mb": answer_bytes / 1e6, "before_mb": before / 1e6, "array": array}
    return [Figure(_NAME, (idle_bytes - before) / 1e6, "MB", context)]


def _largest(server: Server, data_folder: BakedFolder) -> tuple[str, int]:
    """Path and size of the largest array; all are read once."""
    root = f"/api/bakes/{data_folder.bake}/probes"
    sizes = {}
    with urllib.request.urlopen(f"http://127.0.0.1:{server.port}{root}") as answer:
        names = json.load(answer)["arrays"]
    for name in names:
        sizes[f"{root}/{name}"] = _read(server, f"{root}/{name}")
    return max(sizes.items(), key=lambda item: item[1])


def _read(server: Server, path: str) -> int:
    """Size of a response, read in pieces."""
    with urllib.request.urlopen(f"http://127.0.0.1:{server.port}{path}") as answer:
        return sum(iter(lambda: len(answer.read(1 << 16)), 0))


def _ask(connections: ExitStack, server: Server, path: str) -> None:
    connection = connections.enter_context(socket.socket())
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 14)
    connection.connect(("127.0.0.1", server.port))
    connection.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())


def _measure_settled_bytes(server: Server) -> int:
    """Memory of the server once it no longer grows."""
    max_bytes, num_stable = 0, 0
    while num_stable < _NUM_STABLE_READINGS:
        time.sleep(0.5)
        current_bytes = resident_bytes(server.pid)
        num_stable, max_bytes = (num_stable + 1, max_bytes) if current_bytes <= max_bytes else (0, current_bytes)
    return max_bytes
