"""Views whose materials follow other maps of roughness than they were baked with: their samples are sorted anew.

Levels of roughness are coefficients of one operator (docs/adr/0052-roughness-in-levels.md), and bakes say where samples
lie in textures. So an image in the place of a map is another level for each sample, nothing else; as samples of a level
lie together, they come in another order (docs/adr/0102-images-of-roughness.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.bake import StoreReader
from relume.brdf.levels import Levels
from relume.errors import StoreError
from relume.eye.view_samples import thresholds
from relume.eye.windows import morton
from relume.images.shelf import mean_roughness, roughness_of
from relume.scene.roughness import level_of, levels_between, widened
from relume.trace.texture import sample_image
from relume.views.store_io import read_normal_length, read_shortest_normals, read_uv
from relume.views.view import View, open_view

Rows = NDArray[np.int64]
Names = tuple[str | None, ...]


class Reordered:
    """Another store's samples of one view in another order, at other levels of roughness; a `StoreReader`.

    Args:
        store: the other. view: number of the view. rows: of it, the row of each sample here. (surface samples,)
        level: of each sample here. (surface samples,) uint8 ratios: of each material's levels.
    """

    def __init__(
        self,
        store: StoreReader,
        view: int,
        rows: Rows,
        level: NDArray[np.uint8],
        ratios: Sequence[tuple[float, ...]],
    ) -> None:
        self._store, self._prefix, self._rows, self._level = store, f"views/{view}/", rows, level
        self._attributes = {**store.attributes, "roughness_levels": list(map(list, ratios))}

    @property
    def attributes(self) -> Mapping[str, Any]:
        """Those of the store, with these levels."""
        return self._attributes

    def shape(self, path: str) -> tuple[int, ...]:
        """Shape of an array."""
        return self._level.shape if path == f"{self._prefix}level" else self._store.shape(path)

    def read(self, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Rows [start, stop) of the array at a path, those of the view's samples in their order here."""
        if path == f"{self._prefix}level":
            return self._level[start:stop]
        if not path.startswith(self._prefix) or "/" in path.removeprefix(self._prefix):
            return self._store.read(path, start, stop)
        end = self._store.shape(path)[0] if stop is None else stop
        rows = self._rows[start:end]
        if len(rows) == 0:
            return self._store.read(path, start, end)
        first = int(rows.min())
        found = self._store.read(path, first, int(rows.max()) + 1)[rows - first]
        if end <= len(self._rows):
            return found
        return np.concatenate([found, self._store.read(path, len(self._rows), end)])  # behind all surfaces


def rougher(view: View, maps: Names) -> View:
    """Let materials of a baked view follow images in the place of their maps of roughness.

    Args:
        view: as it was baked. maps: "image:<id>" for each material, None for its own.
    Returns:
        The view; the same object for all who have it.
    Raises:
        StoreError: the store does not say where samples lie in textures. NotFoundError, SceneError: an image cannot be
            had.
    """
    known = view.rougher.get(maps)
    if known is not None or not any(maps):
        return known or view
    rows, level, ratios = view.as_baked(), view.level.copy(), list(view.ratios)
    for material, name in enumerate(maps):
        if name is None:
            continue
        of_material = view.rows(material)
        ratios[material], of_samples = _levels_in(view, material, name)
        code = morton(view.pixel[of_material].astype(np.int64), view.width)
        order = np.lexsort((code, of_samples))
        level[of_material], rows[of_material] = of_samples[order], rows[of_material][order]
    store = Reordered(view.store, view.index, rows, level, ratios)
    view.rougher[maps] = found = open_view(store, view.index, view.memory, view.key, maps, rows)
    return found


def _levels_in(view: View, material: int, name: str) -> Levels:
    """How rough a material's samples are where an image says it: what a bake finds whose scene has the image."""
    rows, store = view.rows(material), view.store
    uv = read_uv(store, view.index, rows.start, rows.stop)
    if uv is None:
        raise StoreError("this bake is too old to show images; bake the scene again")
    texture, own = roughness_of(name), mean_roughness(name)
    shortest = read_shortest_normals(store)[material]
    ratios = levels_between(texture, own or None, shortest)
    if not ratios or rows.start == rows.stop:
        return Levels(ratios, np.zeros(rows.stop - rows.start, np.uint8))
    ratio = sample_image(texture, uv)[:, 0]
    if own and shortest < 1:
        ratio = widened(ratio, read_normal_length(store, view.index, rows.start, rows.stop), own)
    pixel = view.pixel[rows].astype(np.int64)
    return Levels(ratios, level_of(ratios, ratio, thresholds(pixel, view.width)))
