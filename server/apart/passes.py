"""Passes of comparisons: the frame, then brute force pass by pass; sums and pictures are files.

A comparison keeps in its folder the frame and the sums of its passes, so that whoever comes later goes on with the next
pass, under other code with the first; after each pass from the second on, the figures and the two pictures there are of
all passes so far.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from relume import look as looks
from relume.code_version import truth_code
from relume.imageio.files import write_image
from relume.picture.jobs import Cancelled, Progress
from relume.picture.transfer import Axis, Opened
from relume.reference.truth import Estimate, compare, error_map
from relume.replacing import replacing
from server.apart.step_timer import sampled
from server.apart.workshop import Workshop
from server.library.ports import F32
from server.wire.bodies import TruthRequest
from worker.paths import scene_path

SPP = 64
_SAMPLE = 4  # times as wide as its sample is a picture whose pace is not known


def make_frame(
    shop: Workshop, tell: Progress, cancelled: Cancelled, *, request: Mapping[str, Any], folder: str
) -> Mapping[str, Any]:
    """The frame that is compared, where it is not there.

    Args:
        request: the comparison's body. folder: its files.
    Returns:
        `passes`: how many there are of it.
    """
    asked, where = TruthRequest.model_validate(request), Path(folder)
    frame, estimate = _load(where)
    if frame is None or estimate is None:
        transfer = shop.transfer(asked.bake)
        look = _look(asked, transfer)
        frame = shop.library.render(transfer, asked.view, look, cancelled=cancelled)
        estimate = Estimate.nothing(*frame.shape[:2])
        _save(where, frame, estimate, look.display)
    return {"passes": estimate.passes}


def make_pass(
    shop: Workshop, tell: Progress, cancelled: Cancelled, *, request: Mapping[str, Any], folder: str
) -> Mapping[str, Any]:
    """One more pass.

    Args:
        request: the comparison's body. folder: its files; `make_frame` was there before.
    Returns:
        `passes`: how many there are now.
    """
    asked, where = TruthRequest.model_validate(request), Path(folder)
    frame, estimate = _load(where)
    if frame is None or estimate is None:  # somebody tidied up
        raise FileNotFoundError(where)
    transfer = shop.transfer(asked.bake)
    look = _look(asked, transfer)
    size = frame.shape[1], frame.shape[0]
    picture = _pass(shop, transfer, asked.view, look, size, estimate.passes, tell, cancelled)
    estimate = estimate.add(picture)
    _save(where, frame, estimate, look.display)
    return {"passes": estimate.passes}


def time_pass(shop: Workshop, tell: Progress, cancelled: Cancelled, *, request: Mapping[str, Any]) -> Mapping[str, Any]:
    """How long a pass takes, by one of a small picture.

    Args:
        request: the comparison's body.
    Returns:
        `seconds` of a pass.
    """
    asked = TruthRequest.model_validate(request)
    transfer = shop.transfer(asked.bake)
    look, view = _look(asked, transfer), transfer.views[asked.view]
    size = max(1, view.width // _SAMPLE), max(1, view.height // _SAMPLE)
    scale = view.width * view.height / (size[0] * size[1])
    return {"seconds": sampled(lambda told: _pass(shop, transfer, asked.view, look, size, 0, told, cancelled), scale)}


def _look(request: TruthRequest, transfer: Opened) -> Any:
    return looks.validate(request.look, transfer.default_look).on_the_map()


def _pass(
    shop: Workshop, transfer: Opened, view: str, look: Any, size: tuple[int, int], index: int, tell: Any, cancelled: Any
) -> F32:
    return shop.library.reference(
        scene_path(shop.data, transfer.scene_id), transfer.views[view].camera, look, size, SPP, tell, cancelled,
        index, reflects=Axis.BOUNCES in transfer.axes,
    )  # fmt: skip


def _load(folder: Path) -> tuple[F32 | None, Estimate | None]:
    """The frame and the passes of an earlier start."""
    path = folder / "passes.npz"
    if not path.exists():
        return None, None
    with np.load(path, allow_pickle=False) as kept:
        if "code" not in kept or str(kept["code"]) != truth_code():  # passes of other code: they are made again
            return None, None
        return kept["frame"], Estimate(kept["sums"], int(kept["passes"]))


def _save(folder: Path, frame: F32, estimate: Estimate, display: Any) -> None:
    """Keep the passes first: whatever is lost after that is made again from them."""
    counted = {"passes": np.array(estimate.passes), "code": np.array(truth_code())}
    with replacing(folder / "passes.npz") as unfinished:
        np.savez(unfinished, allow_pickle=False, frame=frame, sums=estimate.sums, **counted)
    if estimate.passes < 2:
        return
    found, differs = compare(frame, estimate)
    write_image(folder / "reference.png", estimate.mean, display.exposure, display.tone_map)
    with replacing(folder / "error.png") as unfinished:
        Image.fromarray(error_map(frame, estimate, differs)).save(unfinished)
    with replacing(folder / "found.json") as unfinished:
        unfinished.write_text(json.dumps(asdict(found)))
