"""A transfer method of the tests' own, written by following docs/adding-a-method.md: a furnace.

All surfaces glow alike, with half of the mean radiance of the environment, and the environment itself is hidden: what
arrives at a sample is the glow along those of its gather rays that hit anything. Stages: "samples", as those of
`relume.methods.sampled_views`, then "hits".

    views/<k>/links     0 where a gather ray of a sample hits anything, else NO_CELL
    views/<k>/number    of a view sample: seeds its rays
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from relume.bake import ArraySpec, Plan, Recipe, StoreReader, Task, Written
from relume.environments.equirect import texel_solid_angles
from relume.light.gather_rays import make_pattern
from relume.memory import Memory
from relume.methods.opened.baked_views import BakedViews, FewSamples
from relume.methods.opened.described import described
from relume.methods.sampled_views import CHUNK_ROWS, SampledViews
from relume.methods.store_io import SHARD_ROWS
from relume.picture.light import Light
from relume.picture.transfer import Arriving, Axis
from relume.project.sent import Sent, evenly
from relume.scene.model import Scene
from relume.trace.cell_tree import NO_CELL
from relume.trace.cells import choose_cells
from relume.trace.links import trace_links
from relume.views.store_io import read_points
from relume.views.view import View

RAYS, GLOW, SEED = 256, 0.5, 11
_HITS, _CELLS = 1, 64


class FurnaceViews(BakedViews):
    """What is seen in it; light and its ways are the method's own, everything else is shared."""

    axes = frozenset((Axis.CURVE, Axis.PARAMETER, Axis.ENVIRONMENT))

    def glow(self, light: Light) -> Sent:
        """What the one surface sends, the same everywhere."""
        radiance = self.radiance_of(light.environment.map).astype(np.float64)
        share = texel_solid_angles(*radiance.shape[:2]) / (4 * np.pi)
        glow = np.zeros((NO_CELL + 1, 3), np.float32)
        if light.paths.direct:
            glow[0] = GLOW * np.einsum("h,hwc->c", share, radiance) * light.environment_gain
        return evenly(glow)

    def arriving(self, view: View, material: int, light: Light, memory: Memory) -> Arriving:
        """The glow along gather rays, and no light of the environment's own."""
        receivers = view.receivers(material, self.glow(light), is_lit=False)
        return self.lights.none(), receivers

    def some(self, view: View, material: int, chosen: np.ndarray, *, reflects: bool) -> FewSamples:
        """A few samples, for previews."""
        return _FewGlowing(self, view, material, chosen)


class _FewGlowing:
    """A few samples of a material, shaded at once in any light."""

    def __init__(self, furnace: FurnaceViews, view: View, material: int, chosen: np.ndarray) -> None:
        self._furnace, self._view, self._material, self._chosen = furnace, view, material, chosen

    @property
    def num_bytes(self) -> int:
        """Memory they hold."""
        return self._chosen.nbytes

    def arriving(self, light: Light) -> Arriving:
        """The same as at all samples, for these."""
        whole = self._view.receivers(self._material, is_lit=False)
        rays = self._view.gather_rays(self._material, self._furnace.glow(light)).alone(self._chosen)
        return self._furnace.lights.none(), replace(whole.places(self._chosen), rays=(rays,))


class FurnaceMethod:
    """Implements `relume.methods.base.TransferMethod`."""

    name = "furnace"
    stages = ("samples", "hits")

    def __init__(self) -> None:
        self._views = SampledViews()

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        """Upper bounds: the views', with rays in the place of bits."""
        views = self._views.plan(scene, recipe)
        samples = views.num_view_samples
        more = samples * (2 * RAYS + 4)
        num_rays = samples * (RAYS + recipe.num_lights)
        return Plan(samples, num_rays, views.store_bytes + more, views.peak_bytes + more)

    def prepare(self, scene: Scene) -> None:
        """Build the triangles' search tree."""
        self._views.prepare(scene)

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        """What opening the store needs besides its arrays; gather rays of each material: cosine and glossy."""
        return {
            **self._views.attributes(scene, recipe),
            "gather_rays": [[RAYS, 0]] * len(scene.materials),
            "gather_seed": SEED,
        }

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """As the views; then whole shards of each view's surface samples, as their visibility would be."""
        return self._views.tasks(stage, scene, recipe, store)

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """What the rays of each view's samples hit."""
        if stage < _HITS:
            return self._views.arrays(stage, scene, recipe, store)
        return [
            ArraySpec(f"views/{k}/{name}", (rows, *width), dtype, (CHUNK_ROWS, *width), (SHARD_ROWS, *width))
            for k, rows in enumerate(self._views.sampled_of(store).num_surface_samples)
            for name, width, dtype in (("links", (RAYS,), "uint16"), ("number", (), "uint32"))
        ]

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: StoreReader) -> Written:
        """One task; seeds are rows, so the same task gives the same bits anywhere."""
        if task.stage < _HITS:
            return self._views.compute(scene, recipe, task, store)
        k, geometry = recipe.views.index(task.view), self._views.geometry_of(scene)
        tree = choose_cells(scene, geometry, recipe.views, recipe.size, _CELLS).tree
        points = read_points(store, k, task.start, task.stop, np.arange(task.start, task.stop, dtype=np.uint32))
        links = trace_links(geometry, tree, points, points.normal, make_pattern(RAYS, 0, SEED + 1 + k))
        hits = np.where(links.cell == NO_CELL, NO_CELL, 0).astype(np.uint16)
        return Written({f"views/{k}/links": hits, f"views/{k}/number": points.seed}, links.num_rays, links.trace_s)

    def open(self, store: StoreReader, key: str, memory: Memory) -> FurnaceViews:
        """Views that are lit by the glow alone."""
        return FurnaceViews(**described(store, key, memory))
