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

from relume.assets.btf.btf_store import BtfRecord, store_btf
from relume.assets.btf.compress import MAX_TEXELS, compress
from relume.assets.btf.direction_rings import ubo_grid
from relume.assets.btf.local_pca_btf import LocalPcaBtf
from relume.assets.btf.partial_results import PartialCompression
from relume.assets.btf.value_cache import ValueFile
from relume.core.errors import ParameterError
from relume.synthetic_btf.corduroy import corduroy
from relume.synthetic_btf.from_mesh import read_tile
from relume.synthetic_btf.pebbles import pebbles
from relume.synthetic_btf.render import TileGeometry
from relume.synthetic_btf.tileable_geometry import Tile
from relume.synthetic_btf.weave import weave

GEOMETRIES = {"weave": weave, "pebbles": pebbles, "corduroy": corduroy}
MESH: Final = "mesh"
"""Geometry that a file holds."""
MIN_SIZE = 8
MAX_GRID = 8
_SEED = 1
_LIGHT = "fitted"  # what values tell of it, see `relume.synthetic_btf.render`: others are other BTFs
_RENDER_PROGRESS = 0.8  # of the time, about


class SyntheticBtf(NamedTuple):
    """What is to be made.

    Attributes:
        geometry: one of `GEOMETRIES`, or `MESH`. size: texels along each side.
        grid: places along each side of a texel that are looked at, each in light from other directions.
        bound: relative RMS that compression may miss.
        file: of a mesh. period: of it, see `read_tile`.
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
        if not (self.size >= MIN_SIZE and self.size**2 <= MAX_TEXELS):
            raise ParameterError("--size", self.size, f"{MIN_SIZE} to {int(MAX_TEXELS**0.5)} texels")
        if not 1 <= self.grid <= MAX_GRID:
            raise ParameterError("--grid", self.grid, f"1 to {MAX_GRID}")
        if not 1e-4 <= self.bound <= 0.5:
            raise ParameterError("--error", self.bound, "0.0001 to 0.5")

    def tile(self) -> Tile:
        """The geometry. Raises SceneError, ParameterError where a file holds none."""
        return GEOMETRIES[self.geometry]() if self.file is None else read_tile(self.file, self.period)

    def recipe(self, tile: Tile) -> dict[str, Any]:
        """What it is made from, all of it: the same is the same BTF."""
        fields = {name: getattr(self, name) for name in ("geometry", "size", "grid", "bound")}
        if self.file is not None:
            hashed = hashlib.sha256(json.dumps(tile.materials, sort_keys=True).encode())
            for array in tile[:-1]:
                hashed.update(array.tobytes())
            fields["tile"] = hashed.hexdigest()
        return {"synthetic": fields, "seed": _SEED, "light": _LIGHT}


def synthesize_btf(
    folder: Path,
    request: SyntheticBtf,
    name: str,
    progress: Callable[[float], object],
    is_canceled: Callable[[], bool],
    partial_folder: Path | None = None,
) -> BtfRecord:
    """Render and compress; the same again is the same BTF, and one that was begun goes on.

    Args:
        folder: of the asset store. request: what. name: what people call it.
        progress: called with the share done. is_canceled: asked now and then.
        partial_folder: folder of what was rendered so far; by default in `folder`, by what is wanted.
    Raises:
        ParameterError: it cannot be made. CancelledError: `is_canceled` said so; what was rendered stays.
        MaterialError: the store is full. SceneError: the mesh cannot be used.
    """
    request.check()
    tile = request.tile()
    recipe_document = request.recipe(tile)
    key_fields = *request[:3], _LIGHT, recipe_document["synthetic"].get("tile", "")[:16]
    partial_folder = partial_folder or folder / "making" / "-".join(
        str(key_field) for key_field in key_fields if key_field
    )
    partial_folder.mkdir(parents=True, exist_ok=True)
    recipe = partial_folder / "recipe.json"
    recipe.write_text(json.dumps(recipe_document, sort_keys=True))

    def render_and_compress() -> LocalPcaBtf:
        size = request.size, request.size
        values = ValueFile(partial_folder, ubo_grid(), size)
        geometry = TileGeometry(tile, ubo_grid(), size, request.grid, _SEED)
        values.fill(geometry.get_view, lambda share: progress(_RENDER_PROGRESS * share), is_canceled)
        compress_progress = 1 - _RENDER_PROGRESS
        partial_compression = PartialCompression(partial_folder / "compressed", {"bound": request.bound})
        btf = compress(
            values,
            request.bound,
            lambda share: progress(_RENDER_PROGRESS + compress_progress * share),
            is_canceled,
            partial_compression,
        )
        return replace(btf, height=geometry.height())

    record = store_btf(folder, recipe, name, request.geometry, render_and_compress)
    shutil.rmtree(partial_folder)
    return record
