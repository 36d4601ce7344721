"""How true a bake's frame is: passes of brute force, one after another, and what they say of the frame so far.

A comparison keeps in `data`/truths/<id>/ the frame and the sums of its passes, so that a killed server, or a comparison
that was stopped, goes on with the next pass; after each pass from the second on, the figures and the two pictures there
are of all passes so far.
"""

from __future__ import annotations

import json
import os
import threading
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from sqlalchemy.orm import Session, sessionmaker

from relume import look as looks
from relume.imageio import write_image
from relume.reference.truth import Comparison, Estimate, compare, error_map
from server.backlog import Backlog, Work
from server.bodies import TruthRequest
from server.errors import BusyError
from server.live.ports import Library, Transfer
from server.pace import Pace, sampled
from server.tables import TruthRow
from worker.paths import scene_path

F32 = NDArray[np.float32]
SPP = 64
_SAMPLE = 4  # times as wide as its sample is a picture whose pace is not known


@dataclass(frozen=True)
class TruthStatus:
    """One comparison at one moment; `progress` 0…1, `found` once two passes are done."""

    id: str
    request: TruthRequest
    state: str
    passes: int
    progress: float
    seconds_left: float | None
    found: Comparison | None
    problem: str | None


class TruthQueue:
    """Comparisons in the database, one thread that works on them."""

    def __init__(self, sessions: sessionmaker[Session], data: Path, library: Library) -> None:
        self._data, self._library = data, library
        self._backlog = backlog = Backlog(sessions, data / "truths", TruthRow, "comparison", self._work)
        self._paces: dict[str, Pace] = {}
        self._pass_s: dict[tuple[str, str], float] = {}
        self._sampling = threading.Lock()
        self.start, self.close, self.delete = backlog.start, backlog.close, backlog.delete
        self.stop, self.resume = backlog.stop, backlog.resume

    def submit(self, request: TruthRequest) -> str:
        """Queue a comparison whose look was checked. Raises BusyError."""
        return self._backlog.submit(request.model_dump_json())

    def seconds(self, request: TruthRequest, transfer: Transfer) -> float:
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

    def _sampled_pass(self, request: TruthRequest, transfer: Transfer) -> float:
        """Seconds of a pass, by one of a small picture."""
        look = looks.validate(request.look, transfer.default_look).on_the_map()
        view = transfer.views[request.view]
        size = max(1, view.width // _SAMPLE), max(1, view.height // _SAMPLE)

        def closes() -> bool:
            return self._backlog.is_closing

        return sampled(
            lambda tell: self._pass(transfer, request.view, look, size, 0, tell, closes),
            view.width * view.height / (size[0] * size[1]),
        )

    def get(self, identity: str) -> TruthStatus:
        """A comparison. Raises NotFoundError."""
        work = self._backlog.get(identity)
        request = TruthRequest(**work.request)
        pace = self._paces.get(identity) if work.state == "running" else None
        progress = min(1.0, (work.done + (pace.share if pace else 0.0)) / request.passes)
        left = pace.seconds_left(request.passes - work.done) if pace else None
        found = self._found(identity)
        return TruthStatus(identity, request, work.state, work.done, progress, left, found, work.problem)

    def picture_path(self, identity: str, name: str) -> Path:
        """File of a picture, "error" or "reference", there or not."""
        return self._backlog.folder / identity / f"{name}.png"

    def _found(self, identity: str) -> Comparison | None:
        path = self._backlog.folder / identity / "found.json"
        return Comparison(**json.loads(path.read_text())) if path.exists() else None

    def _work(self, work: Work) -> None:
        request, folder = TruthRequest(**work.request), self._backlog.folder / work.id
        transfer = self._library.open_transfer(self._data / "bakes" / f"{request.bake}.zarr")
        look = looks.validate(request.look, transfer.default_look).on_the_map()

        def is_stopped() -> bool:
            return not self._backlog.is_wanted(work.id)

        frame, estimate = _load(folder)
        try:
            if frame is None or estimate is None:
                self._backlog.note(work.id, 0)
                frame = self._library.render(transfer, request.view, look, cancelled=is_stopped)
                estimate = Estimate.nothing(*frame.shape[:2])
            size = frame.shape[1], frame.shape[0]
            pace = self._paces[work.id] = Pace(self._pass_s.get((request.bake, request.view)))
            while estimate.passes < request.passes:
                self._backlog.note(work.id, estimate.passes)
                picture = self._pass(transfer, request.view, look, size, estimate.passes, pace.tell, is_stopped)
                estimate = estimate.add(picture)
                _save(folder, frame, estimate, look.display)
                self._pass_s[request.bake, request.view] = pace.next_step()
        finally:
            self._paces.pop(work.id, None)
        self._backlog.note(work.id, estimate.passes, state="ready")

    def _pass(
        self, transfer: Transfer, view: str, look: Any, size: tuple[int, int], index: int, tell: Any, is_stopped: Any
    ) -> F32:
        return self._library.reference(
            scene_path(self._data, transfer.scene_id), view, look, size, SPP, tell, is_stopped, index,
            reflects=transfer.method == "gather",
        )  # fmt: skip


def _load(folder: Path) -> tuple[F32 | None, Estimate | None]:
    """The frame and the passes of an earlier start."""
    path = folder / "passes.npz"
    if not path.exists():
        return None, None
    with np.load(path, allow_pickle=False) as kept:
        if "sums" not in kept:  # of a version that kept passes otherwise: they are made again
            return None, None
        return kept["frame"], Estimate(kept["sums"], int(kept["passes"]))


def _save(folder: Path, frame: F32, estimate: Estimate, display: Any) -> None:
    """Keep the passes first: whatever is lost after that is made again from them."""
    unfinished = folder / "unfinished.npz"
    np.savez(unfinished, allow_pickle=False, frame=frame, sums=estimate.sums, passes=np.array(estimate.passes))
    os.replace(unfinished, folder / "passes.npz")
    if estimate.passes < 2:
        return
    found, differs = compare(frame, estimate)
    write_image(folder / "reference.png", estimate.mean, display.exposure, display.tone_map)
    Image.fromarray(error_map(frame, estimate, differs)).save(folder / "unfinished.png")
    os.replace(folder / "unfinished.png", folder / "error.png")
    (folder / "unfinished.json").write_text(json.dumps(asdict(found)))
    os.replace(folder / "unfinished.json", folder / "found.json")
