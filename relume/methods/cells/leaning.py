"""Gather cells whose material leans as an image of normals says: what a bake finds whose scene has it as its map.

Each point of a cell takes the normal of its texels, as blurred as its textures are. What then comes up over its horizon
is traced, and its gather rays leave about the normal as it is now; docs/adr/0110-cells-under-images-of-normals.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import NormalMap
from relume.methods.cells.cell_light import CellLight
from relume.trace.surface import any_tangent
from relume.views.leaning import lean
from relume.views.worn_store import Tracer


def leant_cells(cells: CellLight, normals: Sequence[NormalMap | None], tracer: Tracer) -> CellLight:
    """Lean the cells of some materials.

    Args:
        cells: as they were baked. normals: the image that leans each material, None for none. (materials,)
        tracer: of rays that the bake did not trace.
    Returns:
        All cells; those of bakes that do not say how textures lie on them stay as they are.
    Raises:
        StoreError: the store does not say what is needed to trace its rays. NotFoundError, SceneError: an image cannot
            be had.
    Cost: O(points · (rays of a point + lights that come up)) rays.
    """
    if cells.uv is None or cells.surface_normal is None:
        return cells
    for material, map_ in enumerate(normals):
        rows = np.flatnonzero(cells.material == material)
        if map_ is not None and len(rows):
            cells = _leant(cells, rows, map_, tracer)
    return cells


def _leant(cells: CellLight, rows: NDArray[np.intp], map_: NormalMap, tracer: Tracer) -> CellLight:
    """Lean some cells. rows: which. (G,)"""
    assert cells.uv is not None  # who calls has looked
    assert cells.surface_normal is not None
    points = cells.points_of(rows)
    uv, smooth = cells.uv[rows].reshape(points.num_points, -1), cells.surface_normal[rows].reshape(-1, 3)
    normal = lean(map_, uv, smooth, points.normal, points.tangent, smooth).normal
    now = points._replace(normal=normal, tangent=any_tangent(normal))
    known = cells.visible[rows].reshape(points.num_points, -1)
    visible, links = cells.visible.copy(), cells.links.copy()
    visible[rows] = tracer.seen(now, points.normal, known).reshape(visible[rows].shape)
    links[rows] = tracer.linked(now, now.normal, cells.pattern).reshape(links[rows].shape)
    at = (rows[:, None] * cells.points_a_cell + np.arange(cells.points_a_cell)).ravel()
    all_normals, all_tangents = cells.points.normal.copy(), cells.points.tangent.copy()
    all_normals[at], all_tangents[at] = now.normal, now.tangent
    leaning = cells.points._replace(normal=all_normals, tangent=all_tangents)
    return replace(cells, points=leaning, visible=visible, links=links)
