"""Store of display LUTs that users uploaded, in `relume.assets.asset_store`.

    <folder>/<id>/table.npy    from `read_cube`. (N, N, N, 3) uint16
                  lut.json     name, size and warnings

Looks refer to one as "lut:<id>".
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.small_asset_store import SmallAssetRecord, SmallAssetStore
from relume.core.cache import asset_cached
from relume.core.errors import SceneError

U16 = NDArray[np.uint16]


@dataclass(frozen=True)
class LutRecord(SmallAssetRecord):
    """A LUT in lists. size: nodes per channel."""

    size: int


LUTS = SmallAssetStore("LUT", "lut:", "lut.json", SceneError, max_entries=500, record_type=LutRecord)
_TABLE = "table.npy"


def store_lut(folder: Path, source: Path, name: str) -> LutRecord:
    """Import a .cube file; an existing one with this content gets the new name.

    Args:
        folder: folder of the asset store. source: the file. name: shown to users.
    Raises:
        SceneError: the file is unusable, or the store is full.
    """
    from relume.luts.read_cube import read_cube  # loads kernels, which other users do not need

    table, warnings = read_cube(source, name)

    def fill(staged_folder: Path) -> dict[str, Any]:
        np.save(staged_folder / _TABLE, table)
        return {"size": len(table)}

    return LUTS.import_asset(folder, source, name, warnings, fill)


def load_table(name: str) -> Shaped[U16, "N N N 3"]:
    """Load the table of a look's LUT. Raises NotFoundError; SceneError if it is damaged."""
    return _load(LUTS.resolve(name))


@asset_cached("LUT")
def _load(path: Path) -> U16:
    table = LUTS.open_array(path, _TABLE)
    if table.dtype != np.uint16 or table.ndim != 4 or table.shape != (*[len(table)] * 3, 3) or len(table) < 2:
        raise LUTS.damaged_error(path)
    return np.array(table)
