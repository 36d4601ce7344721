"""Makes synthetic BTFs: renders a small geometry from all sides in light from all sides, and compresses that.

What is rendered stays in a folder until it is compressed, so that a run that was killed goes on where it was.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from relume.btf.begun import Begun
from relume.btf.compress import MOST_TEXELS, compress
from relume.btf.eigen import EigenBtf
from relume.btf.rings import ubo_rings
from relume.btf.shelf import BtfRecord, keep
from relume.btf.values import Values
from relume.errors import ParameterError
from relume.synthetic.corduroy import corduroy
from relume.synthetic.mesh import tile_of
from relume.synthetic.pebbles import pebbles
from relume.synthetic.render import SmallGeometry
from relume.synthetic.tile import Tile
from relume.synthetic.weave import weave

GEOMETRIES = {"weave": weave, "pebbles": pebbles, "corduroy": corduroy}
MESH: Final = "mesh"
"""Geometry that a file holds."""
LEAST_SIZE = 8
MOST_GRID = 8
_SEED = 1
_LIGHT = "fitted"  # what values tell of it, see `relume.synthetic.render`: others are other BTFs
_OF_RENDERING = 0.8  # of the time, about


class Made(NamedTuple):
    """What is to be made.

    Attributes:
        geometry: one of `GEOMETRIES`, or `MESH`. size: texels along each side.
        grid: places along each side of a texel that are looked at, each in light from other directions.
        bound: relative RMS that compression may miss.
        file: of a mesh. period: of it, see `tile_of`.
    """

    geometry: str
    size: int
    grid: int
    bound: float
    file: Path | None = None
    period: float | None = None

    def check(self) -> None:
        """Raise ParameterError where it cannot be made."""
        if self.geometry not in GEOMETRIES and self.file is None:
            raise ParameterError("geometry", self.geometry, f"one of {', '.join(GEOMETRIES)}")
        if not (self.size >= LEAST_SIZE and self.size**2 <= MOST_TEXELS):
            raise ParameterError("--size", self.size, f"{LEAST_SIZE} to {int(MOST_TEXELS**0.5)} texels")
        if not 1 <= self.grid <= MOST_GRID:
            raise ParameterError("--grid", self.grid, f"1 to {MOST_GRID}")
        if not 1e-4 <= self.bound <= 0.5:
            raise ParameterError("--error", self.bound, "0.0001 to 0.5")

    def tile(self) -> Tile:
        """The geometry. Raises SceneError, ParameterError where a file holds none."""
        return GEOMETRIES[self.geometry]() if self.file is None else tile_of(self.file, self.period)

    def recipe(self, tile: Tile) -> dict[str, Any]:
        """What it is made from, all of it: the same is the same BTF."""
        made = {name: getattr(self, name) for name in ("geometry", "size", "grid", "bound")}
        if self.file is not None:
            hashed = hashlib.sha256(json.dumps(tile.materials, sort_keys=True).encode())
            for array in tile[:-1]:
                hashed.update(array.tobytes())
            made["tile"] = hashed.hexdigest()
        return {"synthetic": made, "seed": _SEED, "light": _LIGHT}


def make_btf(
    folder: Path,
    wanted: Made,
    name: str,
    progress: Callable[[float], object],
    cancelled: Callable[[], bool],
    making: Path | None = None,
) -> BtfRecord:
    """Render and compress; the same again is the same BTF, and one that was begun goes on.

    Args:
        folder: of the asset store. wanted: what. name: what people call it.
        progress: called with the share done. cancelled: asked now and then.
        making: folder of what was rendered so far; by default in `folder`, by what is wanted.
    Raises:
        ParameterError: it cannot be made. CancelledError: `cancelled` said so; what was rendered stays.
        MaterialError: the store is full. SceneError: the mesh cannot be used.
    """
    wanted.check()
    tile = wanted.tile()
    from_all = wanted.recipe(tile)
    parts = *wanted[:3], _LIGHT, from_all["synthetic"].get("tile", "")[:16]
    making = making or folder / "making" / "-".join(str(part) for part in parts if part)
    making.mkdir(parents=True, exist_ok=True)
    recipe = making / "recipe.json"
    recipe.write_text(json.dumps(from_all, sort_keys=True))

    def make() -> EigenBtf:
        size = wanted.size, wanted.size
        values = Values(making, ubo_rings(), size)
        small = SmallGeometry(tile, ubo_rings(), size, wanted.grid, _SEED)
        values.fill(small.seen_from, lambda share: progress(_OF_RENDERING * share), cancelled)
        rest = 1 - _OF_RENDERING
        begun = Begun(making / "compressed", {"bound": wanted.bound})
        kept = compress(values, wanted.bound, lambda share: progress(_OF_RENDERING + rest * share), cancelled, begun)
        return replace(kept, height=small.height())

    record = keep(folder, recipe, name, wanted.geometry, make)
    shutil.rmtree(making)
    return record
