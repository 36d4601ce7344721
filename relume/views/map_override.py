"""Views with overridden roughness or normal maps.

Roughness levels are coefficients of one operator, and bakes store texture coordinates. So an overridden roughness map
only changes the level of each sample, and with it the order of samples, which are sorted by level. An overridden normal
map changes the normal of each sample, and its level if normals vary within a pixel
(docs/direct-light.md#textures-and-maps).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.roughness_levels import RoughnessLevels
from relume.brdf.texture_slots import NormalMap
from relume.camera.tiling import morton
from relume.camera.view_samples import dither_thresholds
from relume.core.errors import StoreError
from relume.images.image_store import load_normal_map, load_roughness_map, mean_roughness
from relume.images.own_textures import is_own_texture
from relume.math.uv_transform import UvTransform
from relume.raytrace.texture import sample_image
from relume.scene.roughness_levels import (
    levels_in_range,
    min_mean_normal_length,
    ratio_range,
    slope_variance,
)
from relume.views.map_override_store import MapOverrideStore, RayTracer
from relume.views.normal_override import PerturbedNormals, perturbed
from relume.views.store_io import read_normal_length, read_shortest_normals, read_uv
from relume.views.view import View, open_view

F32 = NDArray[np.float32]


class MapOverrides(NamedTuple):
    """Overridden maps of a material.

    Attributes:
        roughness: "image:<id>", None for its own map. normals: None for its own map.
        base_roughness: roughness of its terms in the scene, which normal variation increases; None if no term uses a
            map.
        uv: transform of the coordinates of `roughness`; None: as they are.
    """

    roughness: str | None
    normals: NormalMap | None
    base_roughness: float | None
    uv: UvTransform | None


def with_overrides(view: View, maps: tuple[MapOverrides | None, ...], tracer: RayTracer) -> View:
    """Override maps of materials of a baked view.

    Args:
        view: the baked view. maps: map images of each material, None if it uses its own maps.
        tracer: tracer for rays that the bake did not trace.
    Returns:
        The view; the same object for all callers with the same maps.
    Raises:
        StoreError: the store has no texture coordinates. NotFoundError, SceneError: an image cannot be loaded.
    """
    cached = view.overridden.get(maps)
    if cached is not None or not any(maps):
        return cached or view
    rows, level, pairs = view.unmodified(), view.level.copy(), list(view.level_pairs)
    perturbed_by_row, materials = dict[int, PerturbedNormals](), dict[int, int]()
    for material, override in enumerate(maps):
        material_rows = view.rows(material)
        if override is None or material_rows.start == material_rows.stop:
            continue
        if override.normals is not None:
            tracer.check()
        perturbed_normals = None if override.normals is None else perturbed(view, material, override.normals)
        pairs[material], sample_levels = _overridden_levels(view, material, override, perturbed_normals)
        code = morton(view.pixel[material_rows].astype(np.int64), view.width)
        order = np.lexsort((code, sample_levels))
        level[material_rows], rows[material_rows] = sample_levels[order], rows[material_rows][order]
        if perturbed_normals is not None:
            perturbed_by_row[material_rows.start], materials[material_rows.start] = (
                perturbed_normals.rows(order),
                material,
            )
    tracer_arguments = tracer, view.cache, (view.key, view.name, maps)
    store = MapOverrideStore(view.store, view.index, rows, level, pairs, perturbed_by_row, materials, *tracer_arguments)
    view.overridden[maps] = overridden = open_view(store, view.index, view.cache, view.key, maps, rows)
    return overridden


def _overridden_levels(
    view: View, material: int, override: MapOverrides, perturbed_normals: PerturbedNormals | None
) -> RoughnessLevels:
    """Roughness levels of a material's samples with overridden maps, as if baked with these maps."""
    rows, store, base_roughness = view.rows(material), view.store, override.base_roughness
    shortest = read_shortest_normals(store)[material]
    length = read_normal_length(store, view.index, rows.start, rows.stop)
    ratio, low, high = _map_roughness(view, material)
    if override.roughness is not None:
        uv, texture = read_uv(store, view.index, rows.start, rows.stop), load_roughness_map(override.roughness)
        if uv is None:
            raise StoreError("this bake is too old for image overrides; bake the scene again")
        ratio = sample_image(texture, uv if override.uv is None else override.uv.footprints(uv))[:, 0]
        if not is_own_texture(override.roughness):
            base_roughness, (low, high) = mean_roughness(override.roughness) or None, ratio_range(texture)
    if perturbed_normals is not None and override.normals is not None:
        length, shortest = perturbed_normals.normal_length, min_mean_normal_length(load_normal_map(override.normals))
    grid = levels_in_range(low, high, base_roughness, shortest)
    threshold = dither_thresholds(view.pixel[rows].astype(np.int64), view.width)
    return RoughnessLevels(grid.pairs, grid.select(ratio, slope_variance(length), threshold))


def _map_roughness(view: View, material: int) -> tuple[F32, float, float]:
    """Relative roughness of a material's samples from the scene's map, and the ends of the map's range."""
    pairs, level = view.level_pairs[material], view.level[view.rows(material)]
    ratios = np.array([ratio for ratio, _ in pairs] or [1.0], np.float32)
    return ratios[level], float(ratios.min()), float(ratios.max())
