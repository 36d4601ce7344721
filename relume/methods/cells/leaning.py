"""Gather cells whose material leans as an image of normals says: what a bake finds whose scene has it as its map.

Each point of a cell takes the normal of its texels, as blurred as its textures are. What then comes up over its horizon
is traced, and its gather rays leave about the normal as it is now; docs/adr/0110-cells-under-images-of-normals.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import NormalMap
from relume.methods.cells.cell_light import CellLight
from relume.parallel import for_steps
from relume.points import Points
from relume.trace.tangents import any_tangent
from relume.views.leaning import lean
from relume.views.worn_store import Tracer

_CELLS_A_STEP = 512  # a twentieth of a second's rays


def leant_cells(
    cells: CellLight, normals: Sequence[NormalMap | None], tracer: Tracer, cancelled: Callable[[], bool] = lambda: False
) -> CellLight:
    """Lean the cells of some materials.

    Args:
        cells: as they were baked. normals: the image that leans each material, None for none. (materials,)
        tracer: of rays that the bake did not trace. cancelled: asked now and then.
    Returns:
        All cells; those of bakes that do not say how textures lie on them stay as they are.
    Raises:
        StoreError: the store does not say what is needed to trace its rays. NotFoundError, SceneError: an image cannot
            be had. CancelledError: `cancelled` said so.
    Cost: O(points · (rays of a point + lights that come up)) rays.
    """
    if cells.uv is None or cells.surface_normal is None:
        return cells
    for material, map_ in enumerate(normals):
        rows = np.flatnonzero(cells.material == material)
        if map_ is not None and len(rows):
            leaning = _leaning(cells, rows, map_)
            cells = _traced(cells, leaning, rows, tracer, cancelled)
    return cells


def _leaning(cells: CellLight, rows: NDArray[np.intp], map_: NormalMap) -> Points:
    """The points of all cells where some lean. rows: which. (G,)"""
    assert cells.uv is not None  # who calls has looked
    assert cells.surface_normal is not None
    points = cells.points_of(rows)
    uv, smooth = cells.uv[rows].reshape(points.num_points, -1), cells.surface_normal[rows].reshape(-1, 3)
    found = lean(map_, uv, smooth, points.normal, points.tangent, smooth).normal
    at = (rows[:, None] * cells.points_a_cell + np.arange(cells.points_a_cell)).ravel()
    normal, tangent = cells.points.normal.copy(), cells.points.tangent.copy()
    normal[at], tangent[at] = found, any_tangent(found)
    return cells.points._replace(normal=normal, tangent=tangent)


def _traced(
    cells: CellLight, leaning: Points, rows: NDArray[np.intp], tracer: Tracer, cancelled: Callable[[], bool]
) -> CellLight:
    """Cells with other normals, and what some of them see and hit. leaning: points of all. rows: those cells. (G,)"""
    found = replace(cells, points=leaning, visible=cells.visible.copy(), links=cells.links.copy())

    def trace(start: int, stop: int) -> None:
        some = rows[start:stop]
        before, now = cells.points_of(some), found.points_of(some)
        seen = tracer.seen(now, before.normal, cells.visible[some].reshape(now.num_points, -1))
        found.visible[some] = seen.reshape(len(some), *found.visible.shape[1:])
        found.links[some] = tracer.linked(now, now.normal, cells.pattern).reshape(len(some), -1)

    for_steps(trace, len(rows), _CELLS_A_STEP, lambda share: None, cancelled, "tracing cells that lean")
    return found
