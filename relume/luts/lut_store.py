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

from relume.assets.asset_store import AssetStore
from relume.core.cache import asset_cached
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, warning_of

U16 = NDArray[np.uint16]

LUTS = AssetStore("LUT", "lut:", "lut.json", SceneError, max_entries=500)
_TABLE = "table.npy"


@dataclass(frozen=True)
class LutRecord:
    """A LUT in lists.

    Attributes:
        created: seconds since 1970. size: nodes per channel. warnings: warnings about the import, one sentence each.
    """

    id: str
    name: str
    created: float
    size: int
    warnings: tuple[ImporterWarning, ...]

    @property
    def lut(self) -> str:
        """Name of the LUT in looks."""
        return LUTS.prefix + self.id


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
        return {"size": len(table), "warnings": [warning.document() for warning in warnings]}

    return get_record(folder, LUTS.store(folder, source, name, fill))


def records(folder: Path) -> list[LutRecord]:
    """Return all LUTs of a folder, newest first."""
    return LUTS.records(folder, get_record)


def get_record(folder: Path, identity: str) -> LutRecord:
    """Return one LUT. Raises NotFoundError; SceneError if its files are damaged."""
    path = LUTS.path(folder, identity)
    document = LUTS.load_record(path)
    size, warnings = document.get("size"), document.get("warnings")
    if not isinstance(size, int) or not isinstance(warnings, list):
        raise LUTS.damaged_error(path)
    return LutRecord(identity, document["name"], document["created"], size, tuple(map(warning_of, warnings)))


def load_table(name: str) -> Shaped[U16, "N N N 3"]:
    """Load the table of a look's LUT. Raises NotFoundError; SceneError if it is damaged."""
    return _load(LUTS.resolve(name))


@asset_cached("LUT")
def _load(path: Path) -> U16:
    table = LUTS.open_array(path, _TABLE)
    if table.dtype != np.uint16 or table.ndim != 4 or table.shape != (*[len(table)] * 3, 3) or len(table) < 2:
        raise LUTS.damaged_error(path)
    return np.array(table)
