"""How much disk a bake takes, tried before it is begun: a plan's bound is a hundred times what some scenes take.

A bound counts what each pixel may show and each number may need. So fixed views are tried: the same method bakes the
scene in small pictures, by few lights, and the bytes of its arrays are scaled by how many rows and columns the wanted
ones have more. Rows of small pictures are less alike and compress worse, and more of their pixels lie across edges, so
that what is found is rather too much. Points of the free camera take longer to place than to trace; each part of their
store is planned as the share of its bound that scenes take at most. `relume bench plan` compares plans with stores.

The result is no bound: a scene may be finer where a small picture does not show it. A bake checks the disk as it
writes.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.bake import BakeMethod, Plan, Recipe
from relume.folders import folder_bytes
from relume.memory import stored_as
from relume.methods import bounds
from relume.methods.direct import DirectMethod
from relume.methods.gather import GatherMethod, num_cells
from relume.methods.surface import parts as parts_of_surface
from relume.moving.points.surface import MAX_TEXTURE_SIDE
from relume.scene.model import Scene
from relume.store import bake_here, open_store
from relume.store.publish import array_paths
from relume.store.writer import create_store

SMALL_BYTES = 32 << 20  # plans up to that are as they are bounded
_PIXELS, _LIGHTS, _CELLS = 64 * 48, 300, 256  # of what is tried
_VIEWS = 4  # that are tried
_MARGIN = 1.3
_FINER = 1 / 3  # power with which edges are fewer for each pixel in a larger picture; a tuft of blades has 0.3
_REST_BYTES = 64 << 10  # of metadata
_SCRATCH_ROW_BYTES = 200  # of a sample while samples are sorted
_SHARES = (0.22, 0.6, 0.6, 0.4, 0.8, 0.8, 1.0)  # of the bound of each of `relume.methods.surface.Parts`
_ROWS_TRIED, _PLACES = 16, 8  # of a texture: rows beside each other, and how often


class Disk(NamedTuple):
    """Bytes on disk.

    Attributes:
        store: of the finished store. scratch: of files that are there besides, while samples are sorted.
    """

    store: int
    scratch: int


class Rates(NamedTuple):
    """What a trial took, in bytes.

    Attributes:
        samples: of a pixel. pixels: of a tried picture.
        sample: of a view sample, but for what stands below. light: of a sample and a light. links: of a sample's rays.
        cell: of a gather cell, but for lights. cell_light: of a cell and a light. of_light: of a light.
        constant: of all that stays as it is.
    """

    samples: float
    pixels: float
    sample: float
    light: float
    links: float
    cell: float
    cell_light: float
    of_light: float
    constant: float


def disk_of(method: BakeMethod, scene: Scene, recipe: Recipe, plan: Plan) -> Disk:
    """Find how much disk a bake will take.

    Args:
        method: that bakes. scene: what. recipe: how. plan: of it, with its bound.
    Returns:
        No more than the bound; the bound where it is small, or no method says what it takes.
    """
    find = _METHODS.get(method.name)
    if find is None or plan.store_bytes <= SMALL_BYTES:
        return Disk(plan.store_bytes, 0)
    try:
        found = find(scene, recipe)
    except OSError:  # there is no room for a trial
        return Disk(plan.store_bytes, 0)
    return Disk(min(plan.store_bytes, found.store), found.scratch)


def _tried(make: Callable[[], BakeMethod], cells_of: Callable[[Recipe], int]) -> Callable[[Scene, Recipe], Disk]:
    """Have fixed views tried. make: a method that holds nothing yet. cells_of: how many gather cells a recipe has."""

    def find(scene: Scene, recipe: Recipe) -> Disk:
        small, cells = _small(recipe), cells_of(recipe)
        key = (scene.id, *(camera.name for camera in scene.cameras), small)
        kept: NDArray[np.float64] = stored_as("trial bake", key, lambda: _rates(make(), scene, small))
        rates, num_pixels = Rates(*kept.tolist()), recipe.size[0] * recipe.size[1]
        fewer = min(1.0, rates.pixels / num_pixels) ** (_FINER / 2)
        samples = (1 + max(0.0, rates.samples - 1) * fewer) * num_pixels * len(recipe.views)
        more = max(1.0, math.log2(cells or 1) / math.log2(_CELLS))  # a number of more cells has more bits
        total = samples * (rates.sample + rates.light * recipe.num_lights * fewer + rates.links * more)
        total += cells * (rates.cell * more + rates.cell_light * recipe.num_lights)
        total += rates.of_light * recipe.num_lights + rates.constant
        return Disk(int(_MARGIN * total) + _REST_BYTES, int(samples * _SCRATCH_ROW_BYTES))

    return find


def _small(recipe: Recipe) -> Recipe:
    """What is tried in the place of a recipe: the same for all sizes and numbers of lights."""
    width, height = recipe.size
    scale = min(1.0, math.sqrt(_PIXELS / (width * height)))
    step = -(-len(recipe.views) // _VIEWS)
    views, size = recipe.views[::step], (max(16, round(width * scale)), max(16, round(height * scale)))
    cells = _CELLS if recipe.method == "gather" else None
    return replace(recipe, views=views, size=size, num_lights=_LIGHTS, gather_samples=cells)


def _rates(method: BakeMethod, scene: Scene, small: Recipe) -> NDArray[np.float64]:
    """Bake a little; what it took, as `Rates`."""
    with tempfile.TemporaryDirectory() as folder:
        path = bake_here(method, scene, small, Path(folder) / "trial.zarr")
        store = open_store(path)
        samples = sum(store.shape(f"views/{k}/pixel")[0] for k in range(len(small.views)))
        found = dict.fromkeys(Rates._fields, 0.0)
        for array in array_paths(path):
            found[_field_of(array)] += folder_bytes(path / array)
    pixels = small.size[0] * small.size[1]
    rates = Rates(
        samples=samples / (pixels * len(small.views)), pixels=pixels, sample=found["sample"] / samples,
        light=found["light"] / (samples * small.num_lights), links=found["links"] / samples,
        cell=found["cell"] / _CELLS, cell_light=found["cell_light"] / (_CELLS * small.num_lights),
        of_light=found["of_light"] / small.num_lights, constant=found["constant"],
    )  # fmt: skip
    return np.array(rates)


def _field_of(array: str) -> str:
    """Which of `Rates` the bytes of an array count for."""
    group, _, name = array.partition("/")
    if group == "views":
        return {"visibility": "light", "links": "links"}.get(name.rpartition("/")[2], "sample")
    if group == "cells":
        return "cell_light" if name == "visibility" else "cell"
    return "of_light" if group == "lights" and name != "environment" else "constant"


def _of_surface(scene: Scene, recipe: Recipe) -> Disk:
    """What points of the free camera take: shares of the bound of each part, and the textures as they compress."""
    total = sum(share * most for share, most in zip(_SHARES, parts_of_surface(scene, recipe), strict=True))
    return Disk(int(total + _MARGIN * _texture_bytes(scene)) + _REST_BYTES, 0)


def _texture_bytes(scene: Scene) -> float:
    """Of all textures, each once, by some of their rows."""
    textures = bounds.distinct_textures(scene)
    with tempfile.TemporaryDirectory() as folder:
        store, total = create_store(Path(folder) / "some.zarr", {}), 0.0
        for k, texture in enumerate(textures):
            height, width = texture.pixels.shape[:2]
            starts = np.linspace(0, max(0, height - _ROWS_TRIED), min(_PLACES, height)).astype(int)
            some = np.concatenate([texture.pixels[start : start + _ROWS_TRIED] for start in starts])
            store.write_whole(f"textures/{k}", some.astype(np.float16))
            kept = min(1.0, MAX_TEXTURE_SIDE / height) * min(1.0, MAX_TEXTURE_SIDE / width)
            total += folder_bytes(store.path / "textures" / str(k)) / len(some) * height * kept
        return total


_METHODS = {
    "direct": _tried(DirectMethod, lambda recipe: 0),
    "gather": _tried(GatherMethod, num_cells),
    "surface": _of_surface,
}
