"""btf.*: how quickly BTFs are shown.

`btf.view_fps`, `btf.light_ms`: the still life at 400×400, every surface covered with the weave: frames while the eye
moves, and from a turned environment to the frame, all bounces, followed roughly.
`btf.light_bytes`: what the browser is sent for such a turn as a JPEG of the quality that it asks for, which it gets
where the link is too slow for HDR. `hdr` is the same frame where it is not; `by_browser` what it is sent where it draws
itself, which shows the texels' mean.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bench.btf_made import Made, kept_folder
from bench.figure import Figure
from bench.moving_scene import MovingScene, rotated
from relume.btf.shelf import STORE, BtfRecord
from relume.moving.picture import MovingPicture
from relume.moving.shader.tables import Part
from server.live.sending.painter import jpeg_of
from server.live.state.pending_requests import PendingRequests

_BOUND = 0.05


def measure(tiny: bool) -> list[Figure]:
    """Cover a still life, and turn it and its light."""
    with kept_folder(tiny) as kept, tempfile.TemporaryDirectory() as folder, STORE.at(Path(folder) / "btfs"):
        return _shown(Made("weave", kept, tiny).kept(Path(folder), _BOUND), Path(folder), tiny)


def _shown(record: BtfRecord, folder: Path, tiny: bool) -> list[Figure]:
    still = MovingScene("interior" if tiny else "still_life", folder, (40, 40) if tiny else (400, 400), tiny)

    def covered(document: dict[str, Any]) -> None:
        for material in document["materials"].values():
            material["terms"] = [{**record.terms()[0], "params": {"scale": 4.0}}]

    def turned(document: dict[str, Any], share: float) -> None:
        covered(document)
        rotated(document, share)

    frames = 3 if tiny else 40
    eye, light = still.eye_s(frames, covered), still.edits(frames, turned, is_watched=True)
    frame_bytes = _light_bytes(still, covered, turned)
    context = {"size": "400×400", "points": still.num_points, "every_surface": "woven"}
    return [
        Figure("btf.view_fps", 1 / float(np.median(eye)), "frames/s", context),
        Figure("btf.light_ms", 1e3 * light.median_s, "ms", {**context, **light.said(), "bounces": "all"}),
        Figure("btf.light_bytes", frame_bytes.pop("jpeg") / 1e3, "kB", {**context, **frame_bytes}),
    ]


def _light_bytes(
    still: MovingScene, covered: Callable[[Any], None], turned: Callable[[Any, float], None]
) -> dict[str, float]:
    """Bytes that go to a browser when light is turned: "jpeg", "hdr", "by_browser"."""
    look = still.look(lambda document: turned(document, 0.5))
    picture = still.picture(look, is_watched=True)
    picture.advance(None)
    drawn = {
        "jpeg": len(jpeg_of(picture, look.display, still.size, PendingRequests.quality)),
        "hdr": len(picture.encode(picture.all_tiles(), "rgb9e5")),
    }
    picture = still.picture(still.look(covered), is_watched=True)
    picture.draws = False
    before = _parts(picture)
    picture.set_look(look)
    picture.advance(None)
    new = [part for name, part in _parts(picture).items() if name not in before or before[name].key != part.key]
    return {**drawn, "by_browser": sum(array.nbytes for part in new for array in part.make().values())}


def _parts(picture: MovingPicture) -> Mapping[str, Part]:
    picture.advance(None)
    found = picture.parts()
    assert found is not None
    return found[0]
