"""rooms.join_s: from requesting a session in a room to its first message, with queued thumbnails and a full batch.

A real server on a baked scene without a thumbnail. The worker processes render images that take longer than the
measurement; several clients request the missing thumbnail, and wait; then a few sessions join rooms of their own, one
after another. The figure is the longest time, `quiet_s` the same without load.
"""

from __future__ import annotations

import json
import secrets
import threading
import time
import urllib.request
from contextlib import suppress

from websockets.sync.client import connect

from relume.assets.environments.studio import studio
from relume.store.bake_protocol import Recipe
from relume_bench.baked_server import SPEAKS, BakedFolder, Server, baked_folder, serving
from relume_bench.figure import Figure
from relume_bench.scenes import LAMBERT, cook_torrance, teapot_on_table

_NAME = "rooms.join_s"
_THUMBNAILS = 8


def measure(tiny: bool) -> list[Figure]:
    """Bake, serve, join."""
    size, num_lights, frames, rooms = ((32, 32), 30, 2, 2) if tiny else ((512, 512), 1000, 400, 5)
    scene = teapot_on_table(studio(), (LAMBERT, cook_torrance(0.2)), (LAMBERT,))
    with (
        baked_folder(scene, Recipe("direct", ("front",), size, num_lights)) as data_folder,
        serving(data_folder, {"RELUME_PREWARM": "false"}) as server,
    ):
        _enter(server, data_folder)  # loads the modules of a first session
        quiet_s = max(_enter(server, data_folder) for _ in range(rooms))
        _fill(server, data_folder, frames)
        asking = [threading.Thread(target=_ask, args=(server, data_folder), daemon=True) for _ in range(_THUMBNAILS)]
        for thread in asking:
            thread.start()
        time.sleep(0.1 if tiny else 2.0)  # all are waiting now
        concurrent_s = max(_enter(server, data_folder) for _ in range(rooms))
        waiting = sum(thread.is_alive() for thread in asking)
    context = {"quiet_s": quiet_s, "rooms": rooms, "thumbnails": _THUMBNAILS, "thumbnails_waiting_at_end": waiting}
    return [Figure(_NAME, concurrent_s, "s", context)]


def _enter(server: Server, data_folder: BakedFolder) -> float:
    """Seconds to the first message in a new room."""
    start_time = time.perf_counter()
    room = secrets.token_hex(16)
    address = f"{server.session(data_folder.bake)}?room_prefix={room[:8]}"
    with connect(address, subprotocols=[SPEAKS], max_size=None, compression=None, open_timeout=120) as connection:
        connection.send(json.dumps({"type": "open", "room": room, "name": "Ann"}))
        connection.recv(120)
        return time.perf_counter() - start_time


def _ask(server: Server, data_folder: BakedFolder) -> None:
    with suppress(OSError):  # the server ends before it is rendered
        urllib.request.urlopen(f"http://127.0.0.1:{server.port}/api/scenes/{data_folder.scene}/thumbnail.webp").close()


def _fill(server: Server, data_folder: BakedFolder, frames: int) -> None:
    """Queue a batch whose images are all different."""
    terms = [{"model": "cook_torrance", "params": {"sigma": 0.1 + 0.3 * frame / frames}} for frame in range(frames)]
    looks = [{"materials": {"Teapot": {"terms": [term]}}} for term in terms]
    body = json.dumps({"bake": data_folder.bake, "view": "front", "looks": looks, "format": "png"}).encode()
    headers = {"Content-Type": "application/json"}
    request = urllib.request.Request(f"http://127.0.0.1:{server.port}/api/renders", body, headers)
    urllib.request.urlopen(request).close()
