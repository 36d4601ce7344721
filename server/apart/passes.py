"""Passes of comparisons: the frame, then brute force pass by pass; sums and pictures are files.

A comparison keeps in its folder the frame and the sums of its passes, so that whoever comes later goes on with the next
pass, under other code with the first. Passes are added up twice, by all light paths and by those that the bake's method
follows, where both are asked for. After each pass from the second on there are the figures and pictures of all passes
so far: `error` and `reference` of the paths that were asked for, `method-error` and `method-reference` of the method's;
before, `reference` pictures alone, for nothing tells their noise: at first small ones, which are soon there.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from relume import look as looks
from relume.code_version import truth_code
from relume.errors import CancelledError
from relume.imageio.files import write_image
from relume.methods.sampled_views import MIN_SIDE
from relume.picture.jobs import Cancelled, Progress
from relume.picture.transfer import Axis, Eyes, Opened
from relume.reference.truth import Comparison, Estimate, compare, error_map
from relume.replacing import replacing
from server.apart.animation import compared_from
from server.apart.step_timer import sampled
from server.apart.workshop import Workshop
from server.library.ports import F32
from server.wire.bodies import TruthRequest
from worker.paths import scene_path

if TYPE_CHECKING:
    from relume.reference import Truth

SPP = 64
FIGURES = "figures.json"
_FIRST, _FIRST_SPP = 4, 16  # times as wide as the first pictures is the whole one
_SAMPLE = 8  # times as wide as its sample is a picture whose pace is not known
_Estimates = dict[str, Estimate]  # by whose paths: "all", "method"


def make_frame(
    shop: Workshop, tell: Progress, cancelled: Cancelled, *, request: Mapping[str, Any], folder: str
) -> Mapping[str, Any]:
    """The frame that is compared, and a first brute force to look at, where they are not there.

    Args:
        request: the comparison's body. folder: its files.
    Returns:
        `passes`: how many there are of it.
    """
    asked, where = TruthRequest.model_validate(request), Path(folder)
    kept = _load(where)
    if kept is None:
        transfer = shop.transfer(asked.bake)
        eye = compared_from(asked, transfer) if transfer.eyes is Eyes.FREE else None
        frame = shop.library.render(transfer, asked.view, _look(asked, transfer), cancelled=cancelled, eye=eye)
        kept = frame, {paths: Estimate.nothing(*frame.shape[:2]) for paths in dict.fromkeys((asked.paths, "method"))}
        _write_first(shop, where, transfer, asked, kept[0], cancelled)
        _keep(where, *kept)
    return {"passes": kept[1]["method"].passes}


def _write_first(
    shop: Workshop, folder: Path, transfer: Opened, asked: TruthRequest, frame: F32, cancelled: Cancelled
) -> None:
    """Write small pictures of brute force, of few samples: a pass may take minutes."""
    look, small = _look(asked, transfer), _smaller(_FIRST, frame.shape[1], frame.shape[0])
    truth = _pass(shop, transfer, asked, look, small, 0, lambda share: None, cancelled, spp=_FIRST_SPP)
    for paths in dict.fromkeys((asked.paths, "method")):
        estimate = Estimate.nothing(*truth.pictures[paths].shape[:2]).add(truth.pictures[paths])
        _write_reference(folder, estimate, paths != asked.paths, look.display)


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
    kept = _load(where)
    if kept is None:  # somebody tidied up
        raise FileNotFoundError(where)
    frame, before = kept
    transfer = shop.transfer(asked.bake)
    look, size = _look(asked, transfer), (frame.shape[1], frame.shape[0])
    truth = _pass(shop, transfer, asked, look, size, before["method"].passes, tell, cancelled)
    if cancelled():  # brute force does not ask at its end, and the sums may be another server's now
        raise CancelledError("the pass is not wanted any more")
    after = {paths: estimate.add(truth.pictures[paths]) for paths, estimate in before.items()}
    _keep(where, frame, after)
    _judge(where, frame, after, asked.paths, truth, look.display)
    return {"passes": after["method"].passes}


def time_pass(shop: Workshop, tell: Progress, cancelled: Cancelled, *, request: Mapping[str, Any]) -> Mapping[str, Any]:
    """How long a pass takes, by one of a small picture.

    Args:
        request: the comparison's body.
    Returns:
        `seconds` of a pass.
    """
    asked = TruthRequest.model_validate(request)
    transfer = shop.transfer(asked.bake)
    look, (_, (width, height)) = _look(asked, transfer), compared_from(asked, transfer)
    size = _smaller(_SAMPLE, width, height)
    scale = width * height / (size[0] * size[1])
    return {"seconds": sampled(lambda told: _pass(shop, transfer, asked, look, size, 0, told, cancelled), scale)}


def _smaller(factor: int, width: int, height: int) -> tuple[int, int]:
    factor = max(1, min(factor, width // MIN_SIDE, height // MIN_SIDE))
    return width // factor, height // factor


def _look(request: TruthRequest, transfer: Opened) -> Any:
    return looks.validate(request.look, transfer.default_look).on_the_map()


def _pass(
    shop: Workshop, transfer: Opened, asked: TruthRequest, look: Any, size: tuple[int, int], index: int, tell: Any,
    cancelled: Any, spp: int = SPP,
) -> Truth:  # fmt: skip
    return shop.library.reference(
        scene_path(shop.data, transfer.scene_id), compared_from(asked, transfer)[0], look, size, spp, tell, cancelled,
        index, reflects=Axis.BOUNCES in transfer.axes, is_whole=asked.paths == "all",
    )  # fmt: skip


def _load(folder: Path) -> tuple[F32, _Estimates] | None:
    """The frame and the passes of an earlier start."""
    path = folder / "passes.npz"
    if not path.exists():
        return None
    with np.load(path, allow_pickle=False) as kept:
        if "code" not in kept or str(kept["code"]) != truth_code():  # passes of other code: they are made again
            return None
        sums = {name.removeprefix("sums_"): kept[name] for name in kept if name.startswith("sums_")}
        return kept["frame"], {paths: Estimate(of, int(kept["passes"])) for paths, of in sums.items()}


def _keep(folder: Path, frame: F32, estimates: _Estimates) -> None:
    """Before anything is said of them: whatever is lost after that is made again from them."""
    counted = {"passes": np.array(estimates["method"].passes), "code": np.array(truth_code())}
    sums = {f"sums_{paths}": estimate.sums for paths, estimate in estimates.items()}
    with replacing(folder / "passes.npz") as unfinished:
        np.savez(unfinished, allow_pickle=False, frame=frame, **sums, **counted)


def _judge(folder: Path, frame: F32, estimates: _Estimates, asked: str, truth: Truth, display: Any) -> None:
    """Say what the passes so far say of the frame."""
    figures: dict[str, Any] = {"left_out": truth.left_out, "untraced": truth.untraced}
    if estimates["method"].passes >= 2:
        found = {paths: _shown(folder, frame, of, paths != asked, display) for paths, of in estimates.items()}
        figures |= {"found": asdict(found[asked]), "found_of_method": asdict(found["method"])}
    else:
        for paths, estimate in estimates.items():
            _write_reference(folder, estimate, paths != asked, display)
    with replacing(folder / FIGURES) as unfinished:
        unfinished.write_text(json.dumps(figures))


def _shown(folder: Path, frame: F32, estimate: Estimate, is_beside: bool, display: Any) -> Comparison:
    """Write the pictures of a comparison. is_beside: it is not what was asked for."""
    found, differs = compare(frame, estimate)
    _write_reference(folder, estimate, is_beside, display)
    with replacing(folder / f"{_prefix(is_beside)}error.png") as unfinished:
        Image.fromarray(error_map(frame, estimate, differs)).save(unfinished)
    return found


def _write_reference(folder: Path, estimate: Estimate, is_beside: bool, display: Any) -> None:
    path = folder / f"{_prefix(is_beside)}reference.png"
    write_image(path, estimate.mean, display.exposure, display.tone_map)


def _prefix(is_beside: bool) -> str:
    return "method-" if is_beside else ""
