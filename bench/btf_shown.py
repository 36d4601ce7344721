"""btf.*: how quickly BTFs are shown.

`btf.view_fps`, `btf.light_ms`: the still life at 400×400, every surface covered with the weave: frames while the eye
moves, and from a turned environment to the frame, all bounces, followed roughly.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from bench.btf_made import Made, kept_folder
from bench.figure import Figure
from bench.moving_scene import MovingScene, rotated
from relume.btf.shelf import STORE, BtfRecord

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
    context = {"size": "400×400", "points": still.num_points, "every_surface": "woven"}
    return [
        Figure("btf.view_fps", 1 / float(np.median(eye)), "frames/s", context),
        Figure("btf.light_ms", 1e3 * light.median_s, "ms", {**context, **light.said(), "bounces": "all"}),
    ]
