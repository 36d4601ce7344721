"""The step that makes a BTF, or goes on with it for a while: others have their turns meanwhile."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from relume.btf.importing import import_btf
from relume.btf.shelf import BtfRecord
from relume.errors import CancelledError
from relume.picture.jobs import Cancelled, Progress
from relume.replacing import replacing
from relume.synthetic.make import MESH, Made, make_btf
from server.apart.btf_images import ImagesApart
from server.apart.workshop import Workshop
from server.settings import Settings
from server.wire.btfs import BtfRequest
from worker.paths import btfs_path

SENT, FOUND = "images.zip", "found.json"  # a container or a mesh has the same name: the first bytes tell
_MAKING, _REACHED = "making", "reached.txt"
_GRID = 3  # places along each side of a texel
TURN_S = 30.0


def make(
    shop: Workshop, tell: Progress, cancelled: Cancelled, *, request: Mapping[str, Any], folder: str
) -> Mapping[str, Any]:
    """Render or read it, compress it, keep it; what was found when it was stopped is still there.

    Args:
        request: the work's. folder: its files, what was sent among them.
    Returns:
        `is_done`: whether it is kept; else it is to be gone on with.
    """
    asked, where = BtfRequest.model_validate(request), Path(folder)
    turn = _Turn(tell, cancelled, where / _REACHED)
    try:
        record = _made(asked, where, btfs_path(shop.data), turn)
    except CancelledError:
        if cancelled():
            raise
        turn.leave()
        return {"is_done": False}
    with replacing(where / FOUND) as unfinished:
        unfinished.write_text(json.dumps({"material": record.id}))
    return {"is_done": True}


def _made(asked: BtfRequest, where: Path, shelf: Path, turn: _Turn) -> BtfRecord:
    if asked.geometry is None:
        limits = Settings()  # of the environment, which is the server's
        with closing(ImagesApart(where / SENT, limits.import_bytes, limits.import_seconds)) as images:
            how = asked.name, asked.error, turn.tell, turn.is_over, where / _MAKING, images
            return import_btf(shelf, where / SENT, *how)
    mesh = where / SENT if asked.geometry == MESH else None
    wanted = Made(asked.geometry, asked.size, _GRID, asked.error, mesh, asked.period)
    return make_btf(shelf, wanted, asked.name, turn.tell, turn.is_over, where / _MAKING)


class _Turn:
    """Ends after a while, though not before something was found that no turn before it had.

    Args:
        tell: called with the share done. cancelled: asked now and then. path: file that says what turns have reached.
    """

    def __init__(self, tell: Progress, cancelled: Cancelled, path: Path) -> None:
        self._tell, self._cancelled, self._path = tell, cancelled, path
        self._until_s = time.monotonic() + TURN_S
        self._before = float(path.read_text()) if path.exists() else 0.0
        self._share = 0.0

    def tell(self, share: float) -> None:
        """So much is done, of all turns."""
        self._share = share
        self._tell(share)

    def is_over(self) -> bool:
        """Whether to stop: for now, or because it is not wanted any more."""
        return self._cancelled() or (self._share > self._before and time.monotonic() > self._until_s)

    def leave(self) -> None:
        """Say what was reached."""
        with replacing(self._path) as unfinished:
            unfinished.write_text(str(max(self._share, self._before)))
