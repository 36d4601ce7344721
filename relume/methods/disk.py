"""Estimate of the disk space of a bake before it starts, since a plan's bound can be a hundred times the actual size.

A bound assumes the worst case for each pixel and number. Fixed views are therefore measured: the method bakes small
images of the scene with few lights, and the bytes of its arrays are scaled to the requested rows and columns. Rows of
small images are less alike and compress worse, and more of their pixels lie on edges, so that the estimate is rather
too high. Surface probes take longer to place than to trace; each part of their store is planned as the largest
fraction of its bound that was measured. `relume bench plan` compares plans with stores.
The estimate is not a bound: a small image may miss details of a scene. A bake checks the disk while it writes.
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

from relume.core.cache import get_asset
from relume.core.folder_size import folder_bytes
from relume.methods import plan_estimates
from relume.methods.direct import DirectMethod
from relume.methods.gather import GatherMethod, num_patches
from relume.methods.probes import bound_store_bytes as parts_of_surface
from relume.raytrace.texture_arrays import MAX_TEXTURE_SIDE
from relume.scene.model import Scene
from relume.store.bake_protocol import BakeMethod, Plan, Recipe
from relume.store.publish import array_paths
from relume.store.reader import open_store
from relume.store.run_bake import bake_in_process
from relume.store.writer import create_store

SMALL_BYTES = 32 << 20  # plans up to this size keep their bound
_PIXELS, _LIGHTS, _PATCHES = 64 * 48, 300, 256  # of the trial bake
_VIEWS = 4  # of the trial bake
_MARGIN = 1.3
_EDGE_EXPONENT = 1 / 3  # power of the pixel count by which the fraction of edge pixels falls; 0.3 for a tuft of grass
_METADATA_BYTES = 64 << 10
_SCRATCH_ROW_BYTES = 200  # per sample while samples are sorted
_COMPRESSION_RATIOS = (0.22, 0.6, 0.6, 0.4, 0.8, 0.8, 1.0)  # of the bound of each of `relume.methods.probes.StoreBytes`
_ROWS_PER_BLOCK, _BLOCKS_PER_TEXTURE = 16, 8  # blocks of adjacent rows of a texture


class DiskEstimate(NamedTuple):
    """Bytes on disk.

    Attributes:
        store: path of the finished store. scratch: folder of temporary files while samples are sorted.
    """

    store: int
    scratch: int


class Rates(NamedTuple):
    """Measured sizes of a trial bake, in bytes.

    Attributes:
        samples: samples per pixel. pixels: pixels of a trial image.
        sample: per view sample, without the following. light: per sample and light. gather_hits: per sample.
        patch: per patch, without lights. patch_light: per patch and light. per_light: per light.
        constant: sum of everything that does not scale.
    """

    samples: float
    pixels: float
    sample: float
    light: float
    gather_hits: float
    patch: float
    patch_light: float
    per_light: float
    constant: float


def estimate_disk(method: BakeMethod, scene: Scene, recipe: Recipe, plan: Plan) -> DiskEstimate:
    """Estimate the disk space of a bake.

    Args:
        method, scene, recipe: method, scene and recipe of the bake. plan: with its bound.
    Returns:
        At most the bound; the bound itself if it is small or the method has no estimate.
    """
    estimator = _METHODS.get(method.name)
    if estimator is None or plan.store_bytes <= SMALL_BYTES:
        return DiskEstimate(plan.store_bytes, 0)
    try:
        estimate = estimator(scene, recipe)
    except OSError:  # no space for a trial
        return DiskEstimate(plan.store_bytes, 0)
    return DiskEstimate(min(plan.store_bytes, estimate.store), estimate.scratch)


def _trial_estimator(
    make_method: Callable[[], BakeMethod], count_patches: Callable[[Recipe], int]
) -> Callable[[Scene, Recipe], DiskEstimate]:
    """Estimate by a trial bake. make_method: returns a new method. count_patches: number of patches of a recipe."""

    def estimate(scene: Scene, recipe: Recipe) -> DiskEstimate:
        small, num_patches = _trial_recipe(recipe), count_patches(recipe)
        key = (scene.id, *(camera.name for camera in scene.cameras), small)
        cached_rates: NDArray[np.float64] = get_asset(
            "trial bake", key, lambda: _measure_rates(make_method(), scene, small)
        )
        rates, num_pixels = Rates(*cached_rates.tolist()), recipe.size[0] * recipe.size[1]
        edge_factor = min(1.0, rates.pixels / num_pixels) ** (_EDGE_EXPONENT / 2)
        samples = (1 + max(0.0, rates.samples - 1) * edge_factor) * num_pixels * len(recipe.views)
        # indices of more patches have more bits
        index_bits_factor = max(1.0, math.log2(num_patches or 1) / math.log2(_PATCHES))
        total = samples * (
            rates.sample + rates.light * recipe.num_lights * edge_factor + rates.gather_hits * index_bits_factor
        )
        total += num_patches * (rates.patch * index_bits_factor + rates.patch_light * recipe.num_lights)
        total += rates.per_light * recipe.num_lights + rates.constant
        return DiskEstimate(int(_MARGIN * total) + _METADATA_BYTES, int(samples * _SCRATCH_ROW_BYTES))

    return estimate


def _trial_recipe(recipe: Recipe) -> Recipe:
    """Return the recipe of the trial bake, the same for all sizes and numbers of lights."""
    width, height = recipe.size
    scale = min(1.0, math.sqrt(_PIXELS / (width * height)))
    step = -(-len(recipe.views) // _VIEWS)
    views, size = recipe.views[::step], (max(16, round(width * scale)), max(16, round(height * scale)))
    num_patches = _PATCHES if recipe.method == "gather" else None
    return replace(recipe, views=views, size=size, num_lights=_LIGHTS, num_patches=num_patches)


def _measure_rates(method: BakeMethod, scene: Scene, small: Recipe) -> NDArray[np.float64]:
    """Bake a small recipe; return its `Rates`."""
    with tempfile.TemporaryDirectory() as folder:
        path = bake_in_process(method, scene, small, Path(folder) / "trial.zarr")
        store = open_store(path)
        samples = sum(store.shape(f"views/{k}/pixel")[0] for k in range(len(small.views)))
        field_bytes = dict.fromkeys(Rates._fields, 0.0)
        for array in array_paths(path):
            field_bytes[_rate_field(array)] += folder_bytes(path / array)
    pixels = small.size[0] * small.size[1]
    rates = Rates(
        samples=samples / (pixels * len(small.views)), pixels=pixels, sample=field_bytes["sample"] / samples,
        light=field_bytes["light"] / (samples * small.num_lights), gather_hits=field_bytes["gather_hits"] / samples,
        patch=field_bytes["patch"] / _PATCHES, patch_light=field_bytes["patch_light"] / (_PATCHES * small.num_lights),
        per_light=field_bytes["per_light"] / small.num_lights, constant=field_bytes["constant"],
    )  # fmt: skip
    return np.array(rates)


def _rate_field(array: str) -> str:
    """Return the field of `Rates` that an array counts toward."""
    group, _, name = array.partition("/")
    if group == "views":
        return {"visibility": "light", "gather_hits": "gather_hits"}.get(name.rpartition("/")[2], "sample")
    if group == "patches":
        return "patch_light" if name == "visibility" else "patch"
    return "per_light" if group == "lights" and name != "environment" else "constant"


def _probe_disk(scene: Scene, recipe: Recipe) -> DiskEstimate:
    """Estimate a bake for a free camera: fractions of the bound of each part, and compressed textures."""
    total = sum(
        ratio * bound_bytes
        for ratio, bound_bytes in zip(_COMPRESSION_RATIOS, parts_of_surface(scene, recipe), strict=True)
    )
    return DiskEstimate(int(total + _MARGIN * _texture_bytes(scene)) + _METADATA_BYTES, 0)


def _texture_bytes(scene: Scene) -> float:
    """Estimate the compressed bytes of all distinct textures from some of their rows."""
    textures = plan_estimates.distinct_textures(scene)
    with tempfile.TemporaryDirectory() as folder:
        store, total = create_store(Path(folder) / "some.zarr", {}), 0.0
        for k, texture in enumerate(textures):
            height, width = texture.pixels.shape[:2]
            starts = np.linspace(0, max(0, height - _ROWS_PER_BLOCK), min(_BLOCKS_PER_TEXTURE, height)).astype(int)
            sampled_rows = np.concatenate([texture.pixels[start : start + _ROWS_PER_BLOCK] for start in starts])
            store.write_whole(f"textures/{k}", sampled_rows.astype(np.float16))
            stored_fraction = min(1.0, MAX_TEXTURE_SIDE / height) * min(1.0, MAX_TEXTURE_SIDE / width)
            total += folder_bytes(store.path / "textures" / str(k)) / len(sampled_rows) * height * stored_fraction
        return total


_METHODS = {
    "direct": _trial_estimator(DirectMethod, lambda recipe: 0),
    "gather": _trial_estimator(GatherMethod, num_patches),
    "probes": _probe_disk,
}
