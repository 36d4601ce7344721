"""A transfer method for tests that follows docs/adding-a-method.md: a furnace.

All surfaces emit the same radiance, half of the mean radiance of the environment, and the environment itself is
occluded: the incident light of a sample is this radiance along those of its gather rays that hit a surface. Stages:
"samples", like those of `relume.methods.view_stages`, then "hits".

    views/<k>/gather_hits  0 where a gather ray of a sample hits anything, else NO_CELL
    views/<k>/seed         of a view sample: seeds its rays
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from relume.assets.environments.equirect import texel_solid_angles
from relume.brdf.lobe_sampling import LobeSampling
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.protocols import EditAxis, LightQuality, LightsAndPoints, Samples
from relume.live.opened.fixed_views import BakedFixedViews
from relume.live.opened.samples import SelectedSamples
from relume.methods.store_layout import array_of_rows
from relume.methods.view_stages import SampledViews
from relume.patches.gather_hits import trace_gather_rays
from relume.patches.patch_kdtree import NO_PATCH
from relume.patches.patches import choose_patches
from relume.raytrace.gather_rays import make_pattern
from relume.scene.model import Scene
from relume.store.bake_protocol import ArraySpec, Plan, Recipe, StoreReader, Task, TaskOutput
from relume.transport.outgoing_patch_light import OutgoingLight, isotropic
from relume.views.store_io import read_surface_points
from relume.views.view import View

RAYS, GLOW, SEED = 256, 0.5, 11
_HITS, _CELLS = 1, 64


class FurnaceViews(BakedFixedViews):
    """Views of the furnace: light and its paths are the method's own, everything else is shared."""

    axes = frozenset((EditAxis.CURVE, EditAxis.PARAMETER, EditAxis.ENVIRONMENT))

    def glow(self, light: Illumination) -> OutgoingLight:
        """Outgoing radiance of all surfaces, the same everywhere."""
        radiance = self.environment_radiance(light.environment.map).astype(np.float64)
        row_fraction = texel_solid_angles(*radiance.shape[:2]) / (4 * np.pi)
        glow = np.zeros((NO_PATCH + 1, 3), np.float32)
        if light.paths.direct:
            glow[0] = GLOW * np.einsum("h,hwc->c", row_fraction, radiance) * light.environment_gain
        return isotropic(glow)

    def incident_light(
        self,
        samples: Samples,
        light: Illumination,
        quality: LightQuality = LightQuality.EXACT,
        is_canceled: Callable[[], bool] = lambda: False,
        lobe: LobeSampling | None = None,
        patch_light: Illumination | None = None,
    ) -> LightsAndPoints:
        """Surface radiance along gather rays, without the environment; enough for any lobe, as it is the same."""
        rays = replace(samples.gather_rays(is_canceled), outgoing=self.glow(light))
        return self.lights.empty(), replace(samples.receivers(is_lit=False), rays=(rays,))

    def selected_samples(
        self, view: View, material: int, sample_indices: np.ndarray, *, has_indirect: bool
    ) -> SelectedSamples:
        """Select a few samples for previews."""
        points = view.receivers(material, is_lit=False).without_light(sample_indices)
        rays = view.gather_rays(material).unshared(sample_indices)
        return SelectedSamples(points, self.local, rays)


class FurnaceMethod:
    """Implements `relume.store.bake_protocol.BakeMethod`."""

    name = "furnace"
    stages = ("samples", "hits")

    def __init__(self) -> None:
        self._views = SampledViews()

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        """Upper bounds: those of the views, with rays instead of bits."""
        views = self._views.plan(scene, recipe)
        samples = views.num_view_samples
        ray_bytes = samples * (2 * RAYS + 4)
        num_rays = samples * (RAYS + recipe.num_lights)
        return Plan(samples, num_rays, views.store_bytes + ray_bytes, views.peak_bytes + ray_bytes)

    def prepare(self, scene: Scene) -> None:
        """Build the search tree of the triangles."""
        self._views.prepare(scene)

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        """Attributes for opening the store: gather rays of each material, cosine and glossy."""
        return {
            **self._views.attributes(scene, recipe),
            "gather_rays": [[RAYS, 0]] * len(scene.materials),
            "gather_seed": SEED,
        }

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """Tasks of the views; then whole shards of the surface samples of each view, like visibility."""
        return self._views.tasks(stage, scene, recipe, store)

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """Hits of the gather rays of each view's samples."""
        if stage < _HITS:
            return self._views.arrays(stage, scene, recipe, store)
        return [
            array_of_rows(f"views/{k}/{name}", (rows, *width), dtype)
            for k, rows in enumerate(self._views.view_stage(store).num_surface_samples)
            for name, width, dtype in (("gather_hits", (RAYS,), "uint16"), ("seed", (), "uint32"))
        ]

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: StoreReader) -> TaskOutput:
        """Run one task; seeds are row numbers, so a task gives the same bits anywhere."""
        if task.stage < _HITS:
            return self._views.compute(scene, recipe, task, store)
        k, geometry = recipe.views.index(task.group), self._views.geometry_of(scene)
        tree = choose_patches(scene, geometry, recipe.views, recipe.size, _CELLS).tree
        surface_points = read_surface_points(
            store, k, task.start, task.stop, np.arange(task.start, task.stop, dtype=np.uint32)
        )
        gather_hits = trace_gather_rays(
            geometry, tree, surface_points, surface_points.normal, make_pattern(RAYS, 0, SEED + 1 + k)
        )
        hits = np.where(gather_hits.patch == NO_PATCH, NO_PATCH, 0).astype(np.uint16)
        return TaskOutput(
            {f"views/{k}/gather_hits": hits, f"views/{k}/seed": surface_points.seed},
            gather_hits.num_rays,
            gather_hits.trace_s,
        )
