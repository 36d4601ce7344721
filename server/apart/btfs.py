"""The step that makes a BTF."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from relume.btf.importing import import_zip
from relume.picture.jobs import Cancelled, Progress
from relume.replacing import replacing
from relume.synthetic.make import Made, make_btf
from server.apart.workshop import Workshop
from server.wire.btfs import BtfRequest
from worker.paths import btfs_path

IMAGES, FOUND = "images.zip", "found.json"
_MAKING = "making"
_GRID = 3  # places along each side of a texel


def make(
    shop: Workshop, tell: Progress, cancelled: Cancelled, *, request: Mapping[str, Any], folder: str
) -> Mapping[str, Any]:
    """Render or read it, compress it, keep it; what was found when it was stopped is still there.

    Args:
        request: the work's. folder: its files, the images among them.
    """
    asked, where, shelf = BtfRequest.model_validate(request), Path(folder), btfs_path(shop.data)
    if asked.geometry is None:
        record = import_zip(shelf, where / IMAGES, asked.name, asked.error, tell, cancelled, where / _MAKING)
    else:
        wanted = Made(asked.geometry, asked.size, _GRID, asked.error)
        record = make_btf(shelf, wanted, asked.name, tell, cancelled, where / _MAKING)
    with replacing(where / FOUND) as unfinished:
        unfinished.write_text(json.dumps({"material": record.id}))
    return {}
