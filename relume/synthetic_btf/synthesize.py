"""Synthesis of BTFs: renders a geometry for all view and light directions, and compresses the values.

Rendered values stay in a folder until they are compressed, so that an interrupted run can resume.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

from relume.assets.btf.btf_store import BtfRecord, store_btf
from relume.assets.btf.compress import MAX_TEXELS, compress
from relume.assets.btf.direction_rings import ubo_grid
from relume.assets.btf.local_pca_btf import LocalPcaBtf
from relume.assets.btf.partial_results import PartialCompression
from relume.assets.btf.value_cache import ValueFile, value_bytes
from relume.core.errors import ParameterError
from relume.synthetic_btf.corduroy import corduroy
from relume.synthetic_btf.from_images import ReliefTile
from relume.synthetic_btf.from_mesh import read_tile
from relume.synthetic_btf.pebbles import pebbles
from relume.synthetic_btf.render import TileGeometry
from relume.synthetic_btf.tileable_geometry import Tile
from relume.synthetic_btf.weave import weave

GEOMETRIES = {"weave": weave, "pebbles": pebbles, "corduroy": corduroy}
MESH: Final = "mesh"
"""Geometry from a file."""
IMAGES: Final = "images"
"""Images of heights and colors."""
MIN_SIZE = 8
MAX_GRID = 8
_SEED = 1
_LIGHT = "fitted"  # how values are fitted, see `relume.synthetic_btf.render`; part of the BTF's hash
_RENDER_PROGRESS = 0.8  # approximate fraction of the time


class SyntheticBtf(NamedTuple):
    """A request for a synthetic BTF.

    Attributes:
        geometry: one of `GEOMETRIES`, `MESH` or `IMAGES`. size: texels per side.
        grid: samples along each side of a texel, each with different light directions.
        bound: allowed relative RMS error of the compression.
        file: file of a mesh. period: period of the mesh, see `read_tile`. images: images of heights and colors.
    """

    geometry: str
    size: int
    grid: int
    bound: float
    file: Path | None = None
    period: float | None = None
    images: ReliefTile | None = None

    def check(self) -> None:
        """Raise ParameterError if a value is out of range."""
        if self.images is not None:
            self.images.check()
        elif self.geometry not in GEOMETRIES and self.file is None:
            raise ParameterError("geometry", self.geometry, f"one of {', '.join(GEOMETRIES)}")
        if not (self.size >= MIN_SIZE and self.size**2 <= MAX_TEXELS):
            raise ParameterError("--size", self.size, f"{MIN_SIZE} to {int(MAX_TEXELS**0.5)} texels")
        if not 1 <= self.grid <= MAX_GRID:
            raise ParameterError("--grid", self.grid, f"a number from 1 to {MAX_GRID}")
        if not 1e-4 <= self.bound <= 0.5:
            raise ParameterError("--error", self.bound, "a number from 0.0001 to 0.5")

    def tile(self) -> Tile:
        """Return the geometry. Raises SceneError, ParameterError if the file is unusable."""
        if self.images is not None:
            return self.images.read()
        return GEOMETRIES[self.geometry]() if self.file is None else read_tile(self.file, self.period)

    def recipe(self, tile: Tile) -> dict[str, Any]:
        """Describe all inputs; equal recipes are the same BTF."""
        fields = {name: getattr(self, name) for name in ("geometry", "size", "grid", "bound")}
        if self.geometry not in GEOMETRIES:
            fields["tile"] = _hash_tile(tile)
        return {"synthetic": fields, "seed": _SEED, "light": _LIGHT}


def planned_bytes(size: int) -> int:
    """Size of the rendered values of `size`² texels, beside which the compressed ones are small."""
    return value_bytes(ubo_grid(), (size, size))


def _hash_tile(tile: Tile) -> str:
    textures = [sorted(textures.items()) for textures in tile.textures]
    images = [(channel, texture.wrap, texture.encoding) for items in textures for channel, texture in items]
    hashed = hashlib.sha256(json.dumps([tile.materials, repr(images)], sort_keys=True).encode())
    pixels = [texture.pixels for items in textures for _, texture in items]
    for array in (tile.positions, tile.normals, tile.faces, tile.material, tile.uvs, *pixels):
        hashed.update(array.tobytes())
    return hashed.hexdigest()


def synthesize_btf(
    folder: Path,
    request: SyntheticBtf,
    name: str,
    progress: Callable[[float], object],
    is_canceled: Callable[[], bool],
    partial_folder: Path | None = None,
) -> BtfRecord:
    """Render and compress a BTF; an equal request is the same BTF, and an interrupted one resumes.

    Args:
        folder: folder of the asset store. request: what to render. name: shown to users.
        progress: called with the completed fraction. is_canceled: checked regularly.
        partial_folder: folder of rendered values; by default in `folder`, named by the request.
    Raises:
        ParameterError: a value is out of range. CancelledError: `is_canceled` is true; rendered values stay.
        MaterialError: the store is full. SceneError: the mesh is unusable.
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
        return compress(
            values,
            request.bound,
            lambda share: progress(_RENDER_PROGRESS + compress_progress * share),
            is_canceled,
            partial_compression,
            geometry.height(),
        )

    record = store_btf(folder, recipe, name, request.geometry, render_and_compress)
    shutil.rmtree(partial_folder)
    return record
