"""Method `surface`: pictures whose eye moves (Mahajan 2008, Sun 2007); light is kept at points of all surfaces.

What is baked is what `gather` bakes for view samples, for points that no view owns: which light triangles each sees,
and which cells its gather rays hit. Nothing of it knows a BRDF or an eye. Stages: "points" (the light triangles, the
points, the cells), then "visibility and gather rays" (rows of cells and of points), then "harmonics of light", then
"error of moving pictures", which looks at the bake.

    scene/positions, faces, face_material, uvs, textures, …  what the eye sees: relume.moving.points.surface
    lights/…                                                 as in relume.methods.sampled_views
    cells/…                                                  as in relume.methods.gather
    lattice/num_rows, first, node                            relume.moving.points.lattice.Lattice
    vertices/normal, point, weight                           relume.moving.points.vertices.Vertices
    points/position, normal, tangent, material               relume.moving.points.lattice.Placed
    points/visibility, points/links                          lights that a point sees, cells that its rays hit
    harmonics/…                                              relume.methods.harmonic_light
    thrown/…                                                 as in relume.methods.gather, for stills
    error/moving                                             relume.methods.moving_error
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.bake import ArraySpec, Plan, Recipe, StoreReader, Task, TaskStore, Written
from relume.errors import PlanError
from relume.light.gather_rays import make_pattern
from relume.light.triangles import subdivide
from relume.memory import Memory
from relume.methods import bounds, moving_error
from relume.methods.harmonic_light import harmonic_bytes, make_harmonic_light
from relume.methods.last_read import LastRead
from relume.methods.moving_views import MovingViews
from relume.methods.sampled_views import CHUNK_ROWS, SampledViews, lights_of, read_targets, triangles_of
from relume.methods.store_io import MOVING_ERROR, read_gather_samples, read_moving_error, read_tree
from relume.methods.thrown import make_thrown
from relume.moving.points.density import by_distance, by_shadows
from relume.moving.points.following import POINTS_A_VERTEX
from relume.moving.points.lattice import MAX_POINTS, most_nodes, one_row, place_points
from relume.moving.points.sides import open_sides
from relume.moving.points.surface import pattern_of_points, read_surface_points, tangents_of, textures_of
from relume.points import Points
from relume.scene.model import Scene
from relume.trace.cells import POINTS_A_CELL, choose_cells
from relume.trace.coherent import Targets, trace_coherent
from relume.trace.geometry import Geometry
from relume.trace.links import trace_links
from relume.trace.visibility import Traced, trace_visibility

ROWS_A_SHARD = 4096
RAYS_A_POINT = 377  # a point alone then errs by less than 1 % of its radiance (`surface.points_rmse`)
RAYS_A_CELL_POINT = 55
_FEWEST_CELLS, _MOST_CELLS, _POINTS_A_CELL = 512, 8192, 6
_MOST_ASKED_CELLS = 4 * _MOST_CELLS
MIN_POINTS = 64
_MOST_ALIKE = 54  # points of a material, on both sides, in each of 27 directions
_MORE_POINTS = 1.05  # than asked for, at most
_POINT_BYTES = 3 * 12 + 2
_VERTEX_BYTES = 12 + 2 * 4 * POINTS_A_VERTEX
_MAKING_BYTES_A_NODE = 600  # while nodes are shared: their surface, their keys, and the order of these
_CELL_BYTES = POINTS_A_CELL * (56 + 2 * RAYS_A_CELL_POINT) + 64
_MAKING_BYTES_A_CELL = 4000
_RAY_NS, _TRIANGLE_US = 2000.0, 40.0  # of one core, on scenes of 200 to a million triangles


class SurfaceMethod:
    """Implements `relume.methods.base.TransferMethod`."""

    name = "surface"
    stages = ("points", "visibility and gather rays", "harmonics of light", "error of moving pictures")

    def __init__(self) -> None:
        self._views = SampledViews()
        self._tree_of, self._targets_of = LastRead(read_tree), LastRead(read_targets)

    def prepare(self, scene: Scene) -> None:
        """Build the triangles' search tree."""
        self._views.prepare(scene)

    def open(self, store: StoreReader, key: str, memory: Memory) -> MovingViews:
        """Views from anywhere, lit by the environment, by local lights, and by surfaces. See `TransferMethod`."""
        return replace(MovingViews.of(store, key, memory), moving_error=read_moving_error(store))

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        """Upper bounds from the recipe alone."""
        bounds.check_gathering(recipe, _MOST_ASKED_CELLS)
        checked = self._views.plan(scene, recipe)
        if not MIN_POINTS <= recipe.num_points <= MAX_POINTS:
            raise PlanError(f"{recipe.num_points} points were asked for; give {MIN_POINTS} to {MAX_POINTS:,}")
        points = _most_points(scene, recipe)
        num_cells, rays = _num_cells(recipe), _rays_of(recipe)
        of_cells = POINTS_A_CELL * num_cells
        nodes = most_nodes(bounds.num_triangles(scene), recipe.num_points)
        textures = bounds.texture_bytes(scene)
        alone = max(nodes * _MAKING_BYTES_A_NODE, moving_error.BYTES + points * moving_error.POINT_BYTES)
        num_rays = points * (recipe.num_lights + rays) + of_cells * (recipe.num_lights + RAYS_A_CELL_POINT)
        return Plan(
            num_view_samples=points,
            num_rays=num_rays,
            work_s=bounds.work_s(scene, num_rays, _RAY_NS, _TRIANGLE_US),
            store_bytes=sum(parts(scene, recipe)) + textures + (1 << 20),
            peak_bytes=checked.peak_bytes
            + alone
            + num_cells * _MAKING_BYTES_A_CELL
            + ROWS_A_SHARD * 3 * 2 * rays  # links: traced, joined, written
            + textures,
            lone_bytes=alone,
        )

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        """What opening the store needs besides its arrays."""
        return {
            **self._views.attributes(scene, recipe),
            "gather_seed": int(scene.id[:7], 16),
            "has_harmonics": True,
            "has_moving_error": True,
            **textures_of(scene).described,
        }

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """The lights, the points, the cells; then whole shards of cells and of points. See `BakeMethod`."""
        if stage == 0:
            return [Task(0, index, part, 0, 0) for index, part in enumerate(("lights", "points", "cells"))]
        if stage == 2:
            return [Task(2, 0, "harmonics", 0, 0)]
        if stage == 3:
            return [Task(3, 0, "moving error", 0, 0)]
        rows = {part: store.shape(f"{part}/material")[0] for part in ("cells", "points")}
        ranges = [
            (part, start, min(start + ROWS_A_SHARD, num))
            for part, num in rows.items()
            for start in range(0, num, ROWS_A_SHARD)
        ]
        return [Task(1, index, *where) for index, where in enumerate(ranges)]

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """What cells and points see, and their links; the first stage makes its own. See `BakeMethod`."""
        if stage != 1:
            return []
        bits = (store.shape("lights/power")[0] + 7) // 8
        widths = {
            "cells": (POINTS_A_CELL * bits, POINTS_A_CELL * RAYS_A_CELL_POINT),
            "points": (bits, _rays_of(recipe)),
        }
        return [
            ArraySpec(
                f"{part}/{name}",
                (store.shape(f"{part}/material")[0], width),
                dtype,
                (CHUNK_ROWS, width),
                (ROWS_A_SHARD, width),
            )
            for part, both in widths.items()
            for name, width, dtype in zip(("visibility", "links"), both, ("uint8", "uint16"), strict=True)
        ]

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: TaskStore) -> Written:
        """One task; seeds are the scene's and the numbers of rows: the same bits anywhere. See `BakeMethod`."""
        if task.stage == 0:
            make = {"lights": self._lights, "points": self._points, "cells": self._cells}
            return Written(make[task.view](scene, recipe), 0, 0.0)
        if task.view == "harmonics":
            thrown = make_thrown(scene, self._views.geometry_of(scene), store, store.read("cells/position"))
            return Written(make_harmonic_light(store, int(scene.id[:7], 16)) | thrown, 0, 0.0)
        if task.view == "moving error":
            return Written({MOVING_ERROR: moving_error.measured(store, scene, recipe.size)}, 0, 0.0)
        if task.view not in ("cells", "points"):
            raise ValueError(f"{task.view!r} is not in the stage")
        return self._rows(scene, recipe, task, store)

    def _lights(self, scene: Scene, recipe: Recipe) -> dict[str, NDArray[Any]]:
        geometry = self._views.geometry_of(scene)
        of_corners: dict[str, NDArray[Any]] = {
            "scene/uvs": geometry.uvs,
            "scene/tangents": tangents_of(scene, geometry),
        }
        return {**lights_of(scene, recipe), **triangles_of(geometry, scene), **of_corners, **textures_of(scene).arrays}

    def _points(self, scene: Scene, recipe: Recipe) -> dict[str, NDArray[Any]]:
        geometry = self._views.geometry_of(scene)
        cameras = [camera for camera in scene.cameras if camera.name in recipe.views]
        is_open = open_sides(geometry, cameras, int(scene.id[:7], 16))
        eyes = np.array([camera.to_world[:3, 3] for camera in cameras])
        lights = subdivide(scene.environment.radiance, recipe.num_lights)
        density = by_distance(geometry, eyes, one_row(is_open))
        density = by_shadows(geometry, place_points(geometry, is_open, density, recipe.num_points), eyes, lights)
        placed = place_points(geometry, is_open, density, recipe.num_points)
        fields = {name: getattr(placed.points, name) for name in ("position", "normal", "tangent")}
        return {
            **{f"lattice/{name}": array for name, array in placed.lattice._asdict().items()},
            **{f"vertices/{name}": array for name, array in placed.vertices._asdict().items()},
            **{f"points/{name}": array for name, array in fields.items()},
            "points/material": placed.material,
        }

    def _cells(self, scene: Scene, recipe: Recipe) -> dict[str, NDArray[Any]]:
        cells = choose_cells(scene, self._views.geometry_of(scene), recipe.views, recipe.size, _num_cells(recipe))
        fields: dict[str, NDArray[Any]] = {**vars(cells), **cells.tree._asdict()}
        del fields["tree"]
        return {f"cells/{name}": array for name, array in fields.items()}

    def _rows(self, scene: Scene, recipe: Recipe, task: Task, store: StoreReader) -> Written:
        """What some cells or points see, and what their rays hit."""
        geometry, seed = self._views.geometry_of(scene), int(store.attributes["gather_seed"])
        if task.view == "cells":
            points = read_gather_samples(store, task.start, task.stop)
            pattern = make_pattern(RAYS_A_CELL_POINT, 0, seed)
        else:
            points = read_surface_points(store, task.start, task.stop)
            pattern = pattern_of_points(store, _rays_of(recipe))
        seen = _seen(geometry, points, self._targets_of(store), is_even=task.view == "cells")
        links = trace_links(geometry, self._tree_of(store), points, points.normal, pattern)
        num_rows = task.stop - task.start
        arrays: dict[str, NDArray[Any]] = {
            f"{task.view}/visibility": seen.visible.reshape(num_rows, -1),
            f"{task.view}/links": links.cell.reshape(num_rows, -1),
        }
        return Written(arrays, seen.num_rays + links.num_rays, seen.trace_s + links.trace_s)


def _seen(geometry: Geometry, points: Points, targets: Targets, *, is_even: bool) -> Traced:
    """Find the lights that points see. is_even: they lie evenly, so that much can be predicted; else those that are few
    about their place would take it from others."""
    if not is_even:
        return trace_visibility(geometry.embree, points.position, points.normal, targets.directions)
    found = trace_coherent(geometry.embree, points.position, points.normal, targets)
    return Traced(found.visible, found.rays.traced, found.trace_s)


class Parts(NamedTuple):
    """Numbers of the parts of a store, textures apart."""

    links: int
    points: int
    cells: int
    nodes: int
    harmonics: int
    triangles: int
    lights: int


def parts(scene: Scene, recipe: Recipe) -> Parts:
    """Bound the bytes of each part of a store before it is compressed."""
    points, bits, num_cells = _most_points(scene, recipe), (recipe.num_lights + 7) // 8, _num_cells(recipe)
    triangles = bounds.num_triangles(scene)
    return Parts(
        links=points * 2 * _rays_of(recipe),
        points=points * (_POINT_BYTES + bits),
        cells=POINTS_A_CELL * num_cells * bits + num_cells * _CELL_BYTES,
        nodes=(4 + _VERTEX_BYTES) * most_nodes(triangles, recipe.num_points),
        harmonics=harmonic_bytes(points, num_cells),
        triangles=triangles * 10 + bounds.triangles_bytes(scene) + bounds.corner_bytes(scene),
        lights=bounds.lights_bytes(scene, recipe),
    )


def _most_points(scene: Scene, recipe: Recipe) -> int:
    most_alike = _MOST_ALIKE * len(scene.materials)  # that cannot be shared, however few are asked for
    return int(_MORE_POINTS * recipe.num_points) + most_alike


def _num_cells(recipe: Recipe) -> int:
    """Fewer than points, where the recipe does not say: what they send is gathered over hemispheres, which blurs it."""
    if recipe.gather_samples is not None:
        return recipe.gather_samples
    return min(_MOST_CELLS, max(_FEWEST_CELLS, recipe.num_points // _POINTS_A_CELL))


def _rays_of(recipe: Recipe) -> int:
    """Of a point."""
    return recipe.gather_rays or RAYS_A_POINT
