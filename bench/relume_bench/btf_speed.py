"""btf.*: speed of rendering BTFs.

`btf.view_fps`, `btf.light_ms`: the still life at 400×400, all surfaces covered with the weave: frames while the camera
moves, and the time from rotating the environment to the frame, all bounces, incrementally updated. `btf.light_bytes`:
size of the frame of such a rotation as a JPEG of the quality that the browser requests, which is sent over connections
too slow for HDR. `hdr` is the size of the HDR frame; `by_browser` that of the data for the browser's renderer, which
shows the texels' mean.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from relume.assets.btf.btf_store import STORE, BtfRecord
from relume.live.free_camera.browser.material_arrays import ArrayBlock
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume_bench.btf_synthetic import SyntheticBtf, open_values_folder
from relume_bench.figure import Figure
from relume_bench.free_camera_scene import FreeCameraScene, rotated
from relume_server.client_state.pending_requests import PendingRequests
from relume_server.session.frames.painter import encode_jpeg

_BOUND = 0.05


def measure(tiny: bool) -> list[Figure]:
    """Cover a still life, and rotate camera and light."""
    with (
        open_values_folder(tiny) as values_folder,
        tempfile.TemporaryDirectory() as folder,
        STORE.with_search_folder(Path(folder) / "btfs"),
    ):
        return _measure_free_camera(
            SyntheticBtf("weave", values_folder, tiny).save(Path(folder), _BOUND), Path(folder), tiny
        )


def _measure_free_camera(record: BtfRecord, folder: Path, tiny: bool) -> list[Figure]:
    still_life = FreeCameraScene("interior" if tiny else "still_life", folder, (40, 40) if tiny else (400, 400), tiny)

    def override_with_btf(document: dict[str, Any]) -> None:
        for material in document["materials"].values():
            material["terms"] = [{**record.terms()[0], "params": {"scale": 4.0}}]

    def rotate_light(document: dict[str, Any], fraction: float) -> None:
        override_with_btf(document)
        rotated(document, fraction)

    frames = 3 if tiny else 40
    camera_times, light = (
        still_life.time_camera_moves(frames, override_with_btf),
        still_life.edits(frames, rotate_light, is_watched=True),
    )
    frame_bytes = _light_bytes(still_life, override_with_btf, rotate_light)
    context = {"size": "400×400", "probes": still_life.num_probes, "every_surface": "woven"}
    return [
        Figure("btf.view_fps", 1 / float(np.median(camera_times)), "frames/s", context),
        Figure("btf.light_ms", 1e3 * light.median_s, "ms", {**context, **light.summarize(), "bounces": "all"}),
        Figure("btf.light_bytes", frame_bytes.pop("jpeg") / 1e3, "kB", {**context, **frame_bytes}),
    ]


def _light_bytes(
    still_life: FreeCameraScene, override_with_btf: Callable[[Any], None], rotate_light: Callable[[Any, float], None]
) -> dict[str, float]:
    """Bytes sent to a browser when the light is rotated: "jpeg", "hdr", "by_browser"."""
    look = still_life.look(lambda document: rotate_light(document, 0.5))
    picture = still_life.picture(look, is_watched=True)
    picture.advance(None)
    drawn = {
        "jpeg": len(encode_jpeg(picture, look.display, still_life.size, PendingRequests.quality)),
        "hdr": len(picture.encode(picture.all_tiles(), "rgb9e5")),
    }
    picture = still_life.picture(still_life.look(override_with_btf), is_watched=True)
    picture.renders_pixels = False
    before = _get_cached_parts(picture)
    picture.set_look(look)
    picture.advance(None)
    new = [
        entry
        for name, entry in _get_cached_parts(picture).items()
        if name not in before or before[name].key != entry.key
    ]
    return {**drawn, "by_browser": sum(array.nbytes for entry in new for array in entry.make().values())}


def _get_cached_parts(picture: FreeCameraPicture) -> Mapping[str, ArrayBlock]:
    picture.advance(None)
    cached_parts = picture.array_blocks()
    assert cached_parts is not None
    return cached_parts[0]
