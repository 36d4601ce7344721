"""How true a bake's frame is: passes of brute force, one after another, and what they say of the frame so far.

A comparison keeps in `data`/truths/<id>/ the frame and the sums of its passes, so that a killed server, or a comparison
that was stopped, goes on with the next pass, under other code with the first; after each pass from the second on, the
figures and the two pictures there are of all passes so far.
"""

from __future__ import annotations

import json
import threading
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from sqlalchemy.orm import Session, sessionmaker

from relume import look as looks
from relume.code_version import truth_code
from relume.imageio.files import write_image
from relume.picture.transfer import Axis, Opened
from relume.reference.truth import Comparison, Estimate, compare, error_map
from relume.replacing import replacing
from server.errors import BusyError
from server.library.ports import Library
from server.queues.step_timer import StepTimer, sampled
from server.queues.work_queue import Work, WorkQueue
from server.records.tables import ComparisonRow
from server.wire.bodies import TruthRequest
from worker.paths import scene_path

F32 = NDArray[np.float32]
SPP = 64
_SAMPLE = 4  # times as wide as its sample is a picture whose pace is not known

Comparing = Work[TruthRequest]


class ComparisonQueue(WorkQueue[TruthRequest]):
    """Comparisons in the database, what they found in `data`/truths/<id>/; a step is a pass."""

    row, noun, request_type = ComparisonRow, "comparison", TruthRequest

    def __init__(self, sessions: sessionmaker[Session], data: Path, library: Library) -> None:
        """
        Args:
            sessions: of the database. data: directory of scenes, bakes and what is found. library: paints and traces.
        """
        super().__init__(sessions, data / "truths")
        self._data, self._library = data, library
        self._pass_s: dict[tuple[str, str], float] = {}
        self._sampling = threading.Lock()

    def steps(self, request: TruthRequest) -> int:
        """The passes."""
        return request.passes

    def step_s(self, request: TruthRequest) -> float | None:
        """As passes of this view took before."""
        return self._pass_s.get((request.bake, request.view))

    def seconds(self, request: TruthRequest, transfer: Opened) -> float:
        """What a comparison will take: as passes of this view took before, or as a small picture takes now.

        Raises:
            BusyError: another view is being tried out, and who asks would wait behind it.
            CancelledError: the server closes.
        """
        key = request.bake, request.view
        if key not in self._pass_s:
            if not self._sampling.acquire(blocking=False):
                raise BusyError("another comparison is being estimated; ask again in a moment")
            try:
                self._pass_s[key] = self._sampled_pass(request, transfer)
            finally:
                self._sampling.release()
        return request.passes * self._pass_s[key]

    def _sampled_pass(self, request: TruthRequest, transfer: Opened) -> float:
        """Seconds of a pass, by one of a small picture."""
        look = looks.validate(request.look, transfer.default_look).on_the_map()
        view = transfer.views[request.view]
        size = max(1, view.width // _SAMPLE), max(1, view.height // _SAMPLE)

        return sampled(
            lambda tell: self._pass(transfer, request.view, look, size, 0, tell, lambda: self.is_closing),
            view.width * view.height / (size[0] * size[1]),
        )

    def picture_path(self, identity: str, name: str) -> Path:
        """File of a picture, "error" or "reference", there or not."""
        return self.folder / identity / f"{name}.png"

    def found(self, identity: str) -> Comparison | None:
        """What the passes so far say of the frame; None before the second."""
        path = self.folder / identity / "found.json"
        return Comparison(**json.loads(path.read_text())) if path.exists() else None

    def work(self, work: Comparing, timer: StepTimer) -> None:
        """Make the passes that are missing; the frame first."""
        request, folder = work.request, self.folder / work.id
        transfer = self._library.open_in_passing(self._data / "bakes" / f"{request.bake}.zarr")
        look = looks.validate(request.look, transfer.default_look).on_the_map()

        def is_stopped() -> bool:
            return not self.is_wanted(work.id)

        frame, estimate = _load(folder)
        if frame is None or estimate is None:
            self.note(work.id, 0)
            frame = self._library.render(transfer, request.view, look, cancelled=is_stopped)
            estimate = Estimate.nothing(*frame.shape[:2])
            timer.begin()
        size = frame.shape[1], frame.shape[0]
        while estimate.passes < request.passes:
            self.note(work.id, estimate.passes)
            picture = self._pass(transfer, request.view, look, size, estimate.passes, timer.tell, is_stopped)
            estimate = estimate.add(picture)
            _save(folder, frame, estimate, look.display)
            self._pass_s[request.bake, request.view] = timer.next_step()

    def _pass(
        self, transfer: Opened, view: str, look: Any, size: tuple[int, int], index: int, tell: Any, is_stopped: Any
    ) -> F32:
        return self._library.reference(
            scene_path(self._data, transfer.scene_id), transfer.views[view].camera, look, size, SPP, tell, is_stopped,
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
