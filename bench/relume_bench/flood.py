"""flood.latency_ratio: edit latency with flooding viewers ÷ without, p50, the worse of one and four viewers.

A real server in its own process, the image of `relume_bench.session`. A client edits and waits for the frame, with a
pause in between as in a drag. On the same session, alternating: alone, with one and with four viewers, each in a
process of its own that sends messages as fast as its socket accepts them, and reconnects if it is disconnected:
acknowledgments, edits of the exposure, and rejected edits, alternating.
"""

from __future__ import annotations

import json
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import get_context

import numpy as np
from websockets.sync.client import connect

from relume.assets.environments.studio import studio
from relume.core.errors import PlanError
from relume.store.bake_protocol import Recipe
from relume_bench.baked_server import SPEAKS, BakedFolder, Server, SessionClient, baked_folder, serving, session
from relume_bench.figure import Figure
from relume_bench.flooding import FLOOD_TYPES, flood
from relume_bench.scenes import LAMBERT, cook_torrance, teapot_on_table
from relume_server.collaboration.join import derive_view_token

_SIGMA = "/materials/Teapot/terms/1/params/sigma"
_PAUSE_S = 0.02
_START_S = 60.0


def measure(tiny: bool) -> list[Figure]:
    """Bake, serve, edit without and with floods, alternating."""
    size, num_lights, rounds, seconds = ((64, 64), 60, 1, 0.3) if tiny else ((512, 512), 1000, 3, 4.0)
    scene = teapot_on_table(studio(), (LAMBERT, cook_torrance(0.2)), (LAMBERT,))
    room = secrets.token_hex(16)
    latencies: dict[tuple[str, int], list[float]] = {}
    with (
        baked_folder(scene, Recipe("direct", ("front",), size, num_lights)) as data_folder,
        serving(data_folder, {"RELUME_MAX_PEOPLE": "64"}) as server,  # killed viewers stay members for a while
        session(server, data_folder.bake) as client,
        _flood_room(server, data_folder, room),
    ):
        client.send_message(type="prepare", curve="/materials/Teapot/terms/1/curves/theta_h")
        client.exact(0)
        slider_client = _SliderClient(client)
        slider_client.edit(seconds)  # one-time work is done first
        for _ in range(rounds):
            for kind in FLOOD_TYPES:
                for number in (0, 1, 4):
                    with _flooding(server, data_folder, derive_view_token(room), kind, number):
                        latencies.setdefault((kind, number), []).extend(slider_client.edit(seconds))
    quiet_ms = float(np.median([ms for (_, number), each in latencies.items() if number == 0 for ms in each]))
    medians = {
        f"{kind}_{number}_ms": float(np.median(latencies[kind, number])) for kind in FLOOD_TYPES for number in (1, 4)
    }
    context = {"quiet_ms": quiet_ms, **medians, "rounds": rounds, "seconds": seconds, "size": list(size)}
    return [Figure("flood.latency_ratio", max(medians.values()) / quiet_ms, "ratio", context)]


class _SliderClient:
    """Drags a slider in small steps."""

    def __init__(self, client: SessionClient) -> None:
        self._client, self._revision = client, 0

    def edit(self, seconds: float) -> list[float]:
        """Milliseconds of each edit until a frame shows it."""
        until_s = time.perf_counter() + seconds
        latencies: list[float] = []
        while not latencies or time.perf_counter() < until_s:
            self._revision += 1
            sigma = 0.2 + 0.15 * np.sin(2 * np.pi * self._revision / 90)
            patch = [{"op": "replace", "path": _SIGMA, "value": round(float(sigma), 5)}]
            send_time_s = time.perf_counter()
            self._client.send_message(type="edit", revision=self._revision, patch=patch, active_control=_SIGMA)
            while (frame := self._client.frame()) is None or frame[0]["revision"] < self._revision:
                pass
            latencies.append(1e3 * (time.perf_counter() - send_time_s))
            time.sleep(_PAUSE_S)
        return latencies


@contextmanager
def _flood_room(server: Server, data_folder: BakedFolder, room: str) -> Iterator[None]:
    """Keep an idle editor in the room, so that viewers can join."""
    address = f"{server.session(data_folder.bake)}?room_prefix={room[:8]}"
    with connect(address, subprotocols=[SPEAKS], max_size=None, max_queue=None, compression=None) as editor:
        editor.send(json.dumps({"type": "open", "room": room}))
        SessionClient(editor).exact(0)
        yield


@contextmanager
def _flooding(server: Server, data_folder: BakedFolder, watch: str, kind: str, number: int) -> Iterator[None]:
    address = f"{server.session(data_folder.bake)}?room_prefix={watch[:8]}"
    spawning = get_context("spawn")
    start_events = [spawning.Event() for _ in range(number)]
    viewers = [spawning.Process(target=flood, args=(address, watch, kind, each), daemon=True) for each in start_events]
    for viewer in viewers:
        viewer.start()
    try:
        for each in start_events:
            if not each.wait(_START_S):
                raise PlanError("the server does not read the flood")
        yield
    finally:
        for viewer in viewers:
            viewer.kill()
            viewer.join()
