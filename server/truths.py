"""How true a bake's frame is: passes of brute force, one after another, and what they say of the frame so far.

A comparison keeps in `data`/truths/<id>/ the frame and the sums of its passes, so that a killed server goes on with the
next pass; after each pass from the second on, the figures and the two pictures there are of all passes so far.
"""

from __future__ import annotations

import json
import os
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
from server.live.ports import Library
from server.tables import TruthRow
from worker.paths import scene_path

F32 = NDArray[np.float32]
SPP = 64


@dataclass(frozen=True)
class TruthStatus:
    """One comparison at one moment; `progress` 0…1, `found` once two passes are done."""

    id: str
    request: TruthRequest
    state: str
    passes: int
    progress: float
    found: Comparison | None
    problem: str | None


class TruthQueue:
    """Comparisons in the database, one thread that works on them."""

    def __init__(self, sessions: sessionmaker[Session], data: Path, library: Library) -> None:
        self._data, self._library = data, library
        self._backlog = Backlog(sessions, data / "truths", TruthRow, "comparison", self._work)
        self._shares: dict[str, float] = {}
        self.start, self.close, self.delete = self._backlog.start, self._backlog.close, self._backlog.delete

    def submit(self, request: TruthRequest) -> str:
        """Queue a comparison whose look was checked. Raises BusyError."""
        return self._backlog.submit(request.model_dump_json())

    def get(self, identity: str) -> TruthStatus:
        """A comparison. Raises NotFoundError."""
        work = self._backlog.get(identity)
        request = TruthRequest(**work.request)
        share = self._shares.get(identity, 0.0) if work.state == "running" else 0.0
        progress = min(1.0, (work.done + share) / request.passes)
        return TruthStatus(identity, request, work.state, work.done, progress, self._found(identity), work.problem)

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
        frame, estimate = _load(folder)
        try:
            if frame is None or estimate is None:
                self._backlog.note(work.id, 0)
                frame = self._library.render(
                    transfer, request.view, look, lambda share: None, lambda: not self._backlog.is_wanted(work.id)
                )
                estimate = Estimate.nothing(*frame.shape[:2])
            size = frame.shape[1], frame.shape[0]
            while estimate.passes < request.passes:
                self._backlog.note(work.id, estimate.passes)
                picture = self._library.reference(
                    scene_path(self._data, transfer.scene_id), request.view, look, size, SPP,
                    lambda share: self._shares.__setitem__(work.id, share),
                    lambda: not self._backlog.is_wanted(work.id),
                    estimate.passes,
                    reflects=transfer.method == "gather",
                )  # fmt: skip
                estimate = estimate.with_pass(picture)
                self._shares[work.id] = 0.0
                _save(folder, frame, estimate, look.display)
        finally:
            self._shares.pop(work.id, None)
        self._backlog.note(work.id, estimate.passes, state="ready")


def _load(folder: Path) -> tuple[F32 | None, Estimate | None]:
    """The frame and the passes of an earlier start."""
    path = folder / "passes.npz"
    if not path.exists():
        return None, None
    with np.load(path, allow_pickle=False) as kept:
        return kept["frame"], Estimate(kept["total"], kept["squares"], int(kept["passes"]))


def _save(folder: Path, frame: F32, estimate: Estimate, display: Any) -> None:
    """Keep the passes first: whatever is lost after that is made again from them."""
    kept = {"total": estimate.total, "squares": estimate.squares, "passes": np.array(estimate.passes)}
    unfinished = folder / "unfinished.npz"
    np.savez(unfinished, allow_pickle=False, frame=frame, **kept)
    os.replace(unfinished, folder / "passes.npz")
    if estimate.passes < 2:
        return
    found = compare(frame, estimate)
    write_image(folder / "reference.png", estimate.mean[..., :3].astype(np.float32), display.exposure, display.tone_map)
    Image.fromarray(error_map(frame, estimate)).save(folder / "unfinished.png")
    os.replace(folder / "unfinished.png", folder / "error.png")
    (folder / "unfinished.json").write_text(json.dumps(asdict(found)))
    os.replace(folder / "unfinished.json", folder / "found.json")
