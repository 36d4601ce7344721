"""import.clay_s: seconds from the end of an upload of a million triangles to its clay picture.

The binary PLY of `import.ply`, as the editor uploads it to a server whose importer is loaded: until the scene is
registered (`registered_s`), and until the bytes of its picture of 480 pixels width have arrived. The fastest of a few
scenes; the server has none of them before.
"""

from __future__ import annotations

import http.client
import json
import tempfile
import time
import uuid
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from relume.core.errors import PlanError
from relume_bench.baked_server import BakedFolder, serving
from relume_bench.figure import Figure
from relume_bench.mesh_files import grid, ply_bytes

_ROUNDS = 3
_WIDTH = 480


class _ImportTimes(NamedTuple):
    """Seconds from the end of the upload to the registered scene, and to its picture."""

    registered_s: float
    clay_s: float


def measure(tiny: bool) -> list[Figure]:
    """Upload scenes of different heights, after a small one that starts the importer and compiles."""
    size = 8 if tiny else 707
    with tempfile.TemporaryDirectory() as folder, serving(BakedFolder(Path(folder), "", "", 0.0)) as server:
        _import(server.port, 4, 1.0)
        waits = [_import(server.port, size, 1.0 + number) for number in range(1 if tiny else _ROUNDS)]
    fastest = min(waits, key=lambda each: each.clay_s)
    context = {"triangles": 2 * size**2, "registered_s": fastest.registered_s, "rounds": len(waits)}
    return [Figure("import.clay_s", fastest.clay_s, "s", context)]


def _import(port: int, size: int, height: float) -> _ImportTimes:
    positions, faces = grid(size)
    positions[:, 2] *= height
    content_type, body = _form({"scene": ply_bytes(positions, faces)})
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=300)) as connection:
        connection.request("POST", "/api/scenes", body, {"Content-Type": content_type})  # returns when all is sent
        start_time = time.perf_counter()
        scene = json.loads(_read(connection, 201))["id"]
        registered_s = time.perf_counter() - start_time
        connection.request("GET", f"/api/scenes/{scene}/clay.png?width={_WIDTH}")
        _read(connection, 200)
        return _ImportTimes(registered_s, time.perf_counter() - start_time)


def _form(files: Mapping[str, bytes]) -> tuple[str, bytes]:
    """A multipart form, with its media type."""
    boundary = uuid.uuid4().hex
    parts = [
        f'--{boundary}\r\nContent-Disposition: form-data; name="{name}"; filename="{name}.ply"\r\n\r\n'.encode()
        + content
        + b"\r\n"
        for name, content in files.items()
    ]
    return f"multipart/form-data; boundary={boundary}", b"".join(parts) + f"--{boundary}--\r\n".encode()


def _read(connection: http.client.HTTPConnection, status: int) -> bytes:
    """Read a response. Raises PlanError for another status."""
    answer = connection.getresponse()
    body = answer.read()
    if answer.status != status:
        raise PlanError(f"the server refused: {body[:300].decode(errors='replace')}")
    return body
