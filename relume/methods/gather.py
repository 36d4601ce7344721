"""Method `gather`: environment light with any number of bounces, fixed views (after Nguyen 2010).

What `relume.methods.sampled_views` bakes, and beside it gather cells on the surfaces, the lights that these see, and
gather rays from cells and view samples, of which only the cell that each hits is kept: their directions are made again
from a seed. Stages after those of the views: "gather cells", then "gather rays" (rows of cells, rows of each view).

    cells/axis, value, children, roots          relume.trace.cell_tree.CellTree
    cells/position, normal, material, …         relume.trace.cells.Cells
    cells/visibility                            lights that the points of a cell see, one point after another
    cells/links                                 cells that the rays of its points hit
    views/<k>/links                             cells that the rays of a view sample hit
    views/<k>/number                            of a view sample: seeds its rays
    thrown/…                                    relume.methods.thrown.Thrown: bright lights, planes of flat mirrors
    views/<k>/thrown                            which of those lights a view sample sees in flat mirrors
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.bake import ArraySpec, Plan, Recipe, StoreReader, Task, TaskStore, Written
from relume.brdf.albedo import is_diffuse
from relume.eye.flat_mirrors import lights_in_mirrors
from relume.light.gather_rays import make_pattern
from relume.memory import Memory
from relume.methods import bounds
from relume.methods.last_read import LastRead
from relume.methods.opened.bounced_views import BouncedViews
from relume.methods.opened.described import described
from relume.methods.sampled_views import CHUNK_ROWS, SampledViews
from relume.methods.store_io import SHARD_ROWS, read_cells, read_gather_samples, read_tree
from relume.methods.thrown import make_thrown, most_seen, read_thrown
from relume.scene.model import Scene
from relume.trace.cell_tree import MAX_CELLS
from relume.trace.cells import POINTS_A_CELL, choose_cells
from relume.trace.coherent import trace_coherent
from relume.trace.links import trace_links
from relume.views.store_io import pattern_of_material, read_eyes, read_points, towards

CELLS_A_SHARD = 4096
RAYS_A_SAMPLE, RAYS_A_POINT = 610, 55
_GLOSSY_RAYS = 233
_PIXELS_A_CELL, _FEWEST_CELLS = 10, 1024
_CELLS, _RAYS = 2, 3  # stages
_BYTES_A_CELL = POINTS_A_CELL * (56 + 2 * RAYS_A_POINT) + 64
_NORMAL_BYTES = 240  # of a triangle, while the normals of all are found
_MAKING_BYTES_A_CELL = 4000  # photons, what they hit, and the tree that grows over them
_SHARD_ROW_BYTES = 500  # of a sample beside its links, which are there thrice: traced, joined, written
_RAY_NS, _TRIANGLE_US = 8.0, 3.0  # of one core, on scenes of 200 to a million triangles


class GatherMethod:
    """Implements `relume.methods.base.TransferMethod`.

    Args:
        rays: of a view sample. glossy: of those, where its material has a highlight.
        tents: how often neighbours in the picture share what these bring; see `relume.views.sharing`.
        smooths_edges: whether pixels across edges have several samples.
    """

    name = "gather"
    stages = (*SampledViews.stages, "gather cells", "gather rays")

    def __init__(
        self, rays: int = RAYS_A_SAMPLE, glossy: int = _GLOSSY_RAYS, *, tents: int = 1, smooths_edges: bool = True
    ) -> None:
        self._views, self._rays, self._glossy = SampledViews(smooths_edges=smooths_edges), rays, glossy
        self._tents = tents
        self._tree_of = LastRead(read_tree)

    def prepare(self, scene: Scene) -> None:
        """Build the triangles' search tree."""
        self._views.prepare(scene)

    def open(self, store: StoreReader, key: str, memory: Memory) -> BouncedViews:
        """Views lit by the environment, by local lights, and by surfaces. See `TransferMethod`."""
        return BouncedViews(**described(store, key, memory), cells=read_cells(store), thrown=read_thrown(store))

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        """Upper bounds from the recipe alone."""
        bounds.check_gathering(recipe, MAX_CELLS)
        direct, cells, (rays, _) = self._views.plan(scene, recipe), num_cells(recipe), self._rays_of(recipe)
        points, bits = POINTS_A_CELL * cells, (recipe.num_lights + 7) // 8
        seen = most_seen(scene, recipe)
        num_rays = direct.num_rays + direct.num_view_samples * (rays + 2 * seen)
        num_rays += points * (RAYS_A_POINT + recipe.num_lights)
        return Plan(
            num_view_samples=direct.num_view_samples,
            num_rays=num_rays,
            work_s=bounds.work_s(scene, num_rays * bounds.of_every_position(scene, recipe), _RAY_NS, _TRIANGLE_US),
            store_bytes=direct.store_bytes
            + direct.num_view_samples * (2 * rays + 4 + -(-seen // 8))
            + cells * _BYTES_A_CELL
            + points * bits,
            peak_bytes=direct.peak_bytes
            + cells * _MAKING_BYTES_A_CELL
            + bounds.num_triangles(scene) * _NORMAL_BYTES
            + SHARD_ROWS * (3 * 2 * rays + _SHARD_ROW_BYTES + 2 * seen),
            lone_bytes=direct.lone_bytes,
        )

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        """What opening the store needs besides its arrays; `gather_rays`: cosine and glossy, of each material, and
        `gather_tents`: how often they are shared."""
        rays, about_mirror = self._rays_of(recipe)
        plain, glossy = [rays, 0], [rays - about_mirror, about_mirror]
        direct = self._views.attributes(scene, recipe)
        terms = [direct["look"]["materials"][material.name]["terms"] for material in scene.materials]
        return {
            **direct,
            "gather_rays": [plain if all(map(is_diffuse, of_material)) else glossy for of_material in terms],
            "gather_tents": self._tents,
            "gather_seed": int(scene.id[:7], 16),
        }

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """As the views; the cells; then whole shards of cells and of each view's surface samples. See `BakeMethod`."""
        if stage < _CELLS:
            return self._views.tasks(stage, scene, recipe, store)
        if stage == _CELLS:
            return [Task(stage, 0, "", 0, 0)]
        num_cells = store.shape("cells/material")[0]
        ranges = [("", start, min(start + CELLS_A_SHARD, num_cells)) for start in range(0, num_cells, CELLS_A_SHARD)]
        ranges += [(task.view, task.start, task.stop) for task in self._views.tasks(1, scene, recipe, store)]
        return [Task(stage, index, *where) for index, where in enumerate(ranges)]

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """As the views; what cells see, and all links. See `BakeMethod`."""
        if stage < _RAYS:
            return self._views.arrays(stage, scene, recipe, store) if stage < _CELLS else []
        num_cells, thrown = store.shape("cells/material")[0], read_thrown(store)
        bits = POINTS_A_CELL * ((store.shape("lights/power")[0] + 7) // 8)
        widths = [("cells/visibility", bits, "uint8"), ("cells/links", POINTS_A_CELL * RAYS_A_POINT, "uint16")]
        of_cells = [
            ArraySpec(path, (num_cells, width), dtype, (CHUNK_ROWS, width), (CELLS_A_SHARD, width))
            for path, width, dtype in widths
        ]
        of_samples = [("links", (self._rays_of(recipe)[0],), "uint16"), ("number", (), "uint32")]
        if thrown is not None:
            of_samples.append(("thrown", (-(-thrown.num_seen // 8),), "uint8"))
        of_views = [
            ArraySpec(f"views/{k}/{name}", (rows, *width), dtype, (CHUNK_ROWS, *width), (SHARD_ROWS, *width))
            for k, rows in enumerate(self._views.sampled_of(store).num_surface_samples)
            for name, width, dtype in of_samples
        ]
        return [*of_cells, *of_views]

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: TaskStore) -> Written:
        """One task; seeds are the scene's and the numbers of rows: the same bits anywhere. See `BakeMethod`."""
        if task.stage < _CELLS:
            return self._views.compute(scene, recipe, task, store)
        if task.stage == _CELLS:
            return self._cells(scene, recipe, store)
        return self._of_view(scene, recipe, task, store) if task.view else self._of_cells(scene, task, store)

    def _rays_of(self, recipe: Recipe) -> tuple[int, int]:
        """Rays of a view sample, and of those where its material has a highlight: the same share of any number."""
        rays = recipe.gather_rays or self._rays
        return rays, round(rays * self._glossy / self._rays)

    def _cells(self, scene: Scene, recipe: Recipe, store: StoreReader) -> Written:
        geometry = self._views.geometry_of(scene)
        cells = choose_cells(scene, geometry, recipe.views, recipe.size, num_cells(recipe))
        fields: dict[str, NDArray[Any]] = {**vars(cells), **cells.tree._asdict()}
        del fields["tree"]
        thrown = make_thrown(scene, geometry, store, cells.position)
        return Written({f"cells/{name}": array for name, array in fields.items()} | thrown, 0, 0.0)

    def _of_cells(self, scene: Scene, task: Task, store: StoreReader) -> Written:
        points, geometry = read_gather_samples(store, task.start, task.stop), self._views.geometry_of(scene)
        seen = trace_coherent(geometry.embree, points.position, points.normal, self._views.sampled_of(store).targets)
        pattern = make_pattern(RAYS_A_POINT, 0, int(store.attributes["gather_seed"]))
        links = trace_links(geometry, self._tree_of(store), points, points.normal, pattern)
        num_cells = task.stop - task.start
        arrays: dict[str, NDArray[Any]] = {
            "cells/visibility": seen.visible.reshape(num_cells, -1),
            "cells/links": links.cell.reshape(num_cells, -1),
        }
        return Written(arrays, seen.rays.traced + links.num_rays, seen.trace_s + links.trace_s)

    def _of_view(self, scene: Scene, recipe: Recipe, task: Task, store: StoreReader) -> Written:
        k = recipe.views.index(task.view)
        seed, parts = np.arange(task.start, task.stop, dtype=np.uint32), []
        points = read_points(store, k, task.start, task.stop, seed)
        wo = towards(read_eyes(store, k, task.start, task.stop), points.position)
        material = store.read(f"views/{k}/material", task.start, task.stop)
        geometry, tree = self._views.geometry_of(scene), self._tree_of(store)
        for index in np.unique(material):
            first, stop = np.searchsorted(material, [index, index + 1])
            pattern = pattern_of_material(store, k, int(index))
            parts.append(trace_links(geometry, tree, points.rows(slice(first, stop)), wo[first:stop], pattern))
        arrays = {f"views/{k}/links": np.concatenate([part.cell for part in parts]), f"views/{k}/number": seed}
        num_rays = sum(part.num_rays for part in parts)
        if (thrown := read_thrown(store)) is not None:
            seen = lights_in_mirrors(geometry, thrown.mirrors, points, thrown.direction)
            arrays[f"views/{k}/thrown"], num_rays = seen.visible, num_rays + seen.num_rays
        return Written(arrays, num_rays, sum(part.trace_s for part in parts))


def num_cells(recipe: Recipe) -> int:
    """As many as the pictures' pixels can tell apart, where the recipe does not say."""
    if recipe.gather_samples is not None:
        return recipe.gather_samples
    width, height = recipe.size
    return min(MAX_CELLS, max(_FEWEST_CELLS, len(recipe.views) * width * height // _PIXELS_A_CELL))
