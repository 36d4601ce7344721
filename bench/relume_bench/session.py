"""session.edit_to_socket_ms: from receiving an edit at the server to sending its frame, while σ is dragged.

A real server in its own process, an image of 512×512 in which one material covers about 30 %; a client that drags σ of
its cook_torrance term back and forth, 60 edits per second, and acknowledges each frame. The times are the server's own
(see `relume_bench.recording_server`); those of the freeze before the drag are excluded.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from relume.assets.environments.studio import studio
from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.store.bake_protocol import Recipe
from relume_bench.baked_server import SessionClient, baked_folder, serving, session
from relume_bench.figure import Figure
from relume_bench.scenes import LAMBERT, cook_torrance, teapot_on_table
from relume_bench.timing import percentiles
from relume_worker.paths import bake_path

_SIGMA = "/materials/Teapot/terms/1/params/sigma"
_EDITS_A_SECOND = 60.0
_FRAME_STAGES = ("wait", "update", "encode")


def measure(tiny: bool) -> list[Figure]:
    """Bake, serve, drag."""
    size, num_lights, num_edits = ((64, 64), 60, 10) if tiny else ((512, 512), 1000, 600)
    scene = teapot_on_table(studio(), (LAMBERT, cook_torrance(0.2)), (LAMBERT,))
    with baked_folder(scene, Recipe("direct", ("front",), size, num_lights)) as data_folder:
        ids = open_transfer(bake_path(data_folder.data, data_folder.bake), Cache(4 << 30)).views["front"].material_ids()
        with serving(data_folder) as server, session(server, data_folder.bake) as client:
            client.send_message(type="prepare", curve="/materials/Teapot/terms/1/curves/theta_h")
            client.exact(0)
            client.send_message(type="edit", revision=1, patch=[{"op": "replace", "path": _SIGMA, "value": 0.19}])
            client.exact(1)
            before = len(server.edit_ms())
            frames = _drag(client, num_edits)
            times = server.edit_ms()[before:]
    p50, p95 = percentiles(times)
    context = {
        "edits": num_edits,
        "frames": len(times),
        "size": list(size),
        "pixel_fraction": float(np.mean(ids == 0)),
        "frame_bytes_median": float(np.median([num_bytes for _, num_bytes in frames])),
        **{
            f"{stage}_ms_median": float(np.median([header["ms"][stage] for header, _ in frames]))
            for stage in _FRAME_STAGES
        },
        "max_ms": max(times),
    }
    return [
        Figure("session.edit_to_socket_ms.p50", p50, "ms", context),
        Figure("session.edit_to_socket_ms.p95", p95, "ms", context),
    ]


def _drag(client: SessionClient, num_edits: int) -> list[tuple[dict[str, Any], int]]:
    """Change σ at a constant rate, reading frames in between; return their headers and sizes."""
    start_time, frames = time.perf_counter(), []
    for k in range(num_edits):
        sigma = 0.2 + 0.15 * np.sin(2 * np.pi * k / 90)
        patch = [{"op": "replace", "path": _SIGMA, "value": round(float(sigma), 5)}]
        client.send_message(type="edit", revision=2 + k, patch=patch)
        while (remaining_s := start_time + (k + 1) / _EDITS_A_SECOND - time.perf_counter()) > 0:
            if (received := client.frame(remaining_s)) is not None:
                frames.append(received)
    client.exact(1 + num_edits)
    return frames
