"""Views whose materials wear other maps of roughness or of normals than they were baked with.

Levels of roughness are coefficients of one operator (docs/adr/0052-roughness-in-levels.md), and bakes say where samples
lie in textures. So an image in the place of a map of roughness is another level for each sample, nothing else; as
samples of a level lie together, they come in another order (docs/adr/0102-images-of-roughness.md). An image of normals
is another normal for each, and another level where bumps below a pixel widen it (docs/adr/0107-images-of-normals.md).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import NormalMap
from relume.brdf.levels import Levels
from relume.errors import StoreError
from relume.eye.view_samples import thresholds
from relume.eye.windows import morton
from relume.images.shelf import mean_roughness, normals_of, roughness_of
from relume.scene.roughness import ends_of, level_of, levels_over, narrowed, shortest_normal, widened
from relume.trace.texture import sample_image
from relume.views.leaning import Leant, leant
from relume.views.store_io import read_normal_length, read_shortest_normals, read_uv
from relume.views.view import View, open_view
from relume.views.worn_store import Tracer, WornStore

F32 = NDArray[np.float32]


class Maps(NamedTuple):
    """What a look names in the place of a material's maps.

    Attributes:
        roughness: "image:<id>", None for its own. normals: None for its own.
        own: the roughness of its terms, as the scene has it, that bumps widen; None where no term follows a map.
    """

    roughness: str | None
    normals: NormalMap | None
    own: float | None


def worn(view: View, maps: tuple[Maps | None, ...], tracer: Tracer) -> View:
    """Let materials of a baked view wear images in the place of their maps.

    Args:
        view: as it was baked. maps: of each material, None where it wears its own.
        tracer: of rays that the bake did not trace.
    Returns:
        The view; the same object for all who have it.
    Raises:
        StoreError: the store does not say where samples lie in textures. NotFoundError, SceneError: an image cannot be
            had.
    """
    known = view.worn.get(maps)
    if known is not None or not any(maps):
        return known or view
    rows, level, ratios = view.as_baked(), view.level.copy(), list(view.ratios)
    under, materials = dict[int, Leant](), dict[int, int]()
    for material, wears in enumerate(maps):
        of_material = view.rows(material)
        if wears is None or of_material.start == of_material.stop:
            continue
        if wears.normals is not None:
            tracer.check()
        bumps = None if wears.normals is None else leant(view, material, wears.normals)
        ratios[material], of_samples = _levels(view, material, wears, bumps)
        code = morton(view.pixel[of_material].astype(np.int64), view.width)
        order = np.lexsort((code, of_samples))
        level[of_material], rows[of_material] = of_samples[order], rows[of_material][order]
        if bumps is not None:
            under[of_material.start], materials[of_material.start] = bumps.rows(order), material
    rays = tracer, view.memory, (view.key, view.name, maps)
    store = WornStore(view.store, view.index, rows, level, ratios, under, materials, *rays)
    view.worn[maps] = found = open_view(store, view.index, view.memory, view.key, maps, rows)
    return found


def _levels(view: View, material: int, wears: Maps, bumps: Leant | None) -> Levels:
    """How rough a material's samples are where images say it: what a bake finds whose scene has the images."""
    rows, store, own = view.rows(material), view.store, wears.own
    shortest = read_shortest_normals(store)[material]
    length = read_normal_length(store, view.index, rows.start, rows.stop)
    if wears.roughness is None:
        ratio, low, high = _unwidened(view, material, own, length, shortest)
    else:
        uv, texture = read_uv(store, view.index, rows.start, rows.stop), roughness_of(wears.roughness)
        if uv is None:
            raise StoreError("this bake is too old to show images; bake the scene again")
        own = mean_roughness(wears.roughness) or None
        ratio, (low, high) = sample_image(texture, uv)[:, 0], ends_of(texture)
    if bumps is not None and wears.normals is not None:
        length, shortest = bumps.normal_length, shortest_normal(normals_of(wears.normals))
    ratios = levels_over(low, high, own, shortest)
    if not ratios:
        return Levels(ratios, np.zeros(rows.stop - rows.start, np.uint8))
    if own and shortest < 1:
        ratio = widened(ratio, length, own)
    pixel = view.pixel[rows].astype(np.int64)
    return Levels(ratios, level_of(ratios, ratio, thresholds(pixel, view.width)))


def _unwidened(view: View, material: int, own: float | None, length: F32, shortest: float) -> tuple[F32, float, float]:
    """The roughness of a material's samples over its own as the scene's map has it, without what bumps add; and the
    ends of that map."""
    ratios, level = view.ratios[material], view.level[view.rows(material)]
    if not ratios or ratios[0] == 1:  # there is no map, or bumps alone widen it
        return np.ones(len(level), np.float32), 1.0, 1.0
    ratio, low, high = np.array(ratios, np.float32)[level], ratios[0], ratios[-1]
    if own is None or shortest == 1:
        return ratio, low, high
    highest = narrowed(np.array([high], np.float32), np.array([shortest], np.float32), own)
    return narrowed(ratio, length, own), low, max(low, float(highest[0]))
