"""Method `direct`: environment light, fixed views, shadows, no bounces (Ben-Artzi 2006).

Its store holds the arrays of `relume.methods.view_stages`, and:

    textures/<k>, roughness/<k>                 relume.raytrace.texture_arrays
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from relume.methods import plan_estimates
from relume.methods.view_stages import SampledViews
from relume.raytrace.texture_arrays import texture_arrays, texture_attributes
from relume.scene.model import Scene
from relume.store.bake_protocol import ArraySpec, Plan, Recipe, StoreReader, Task, TaskOutput, TaskStore


class DirectMethod:
    """Implements `relume.store.bake_protocol.BakeMethod`.

    Args:
        smooths_edges: whether pixels on edges have several samples.
    """

    name = "direct"
    stages = SampledViews.stages

    def __init__(self, *, smooths_edges: bool = True) -> None:
        self._views = SampledViews(smooths_edges=smooths_edges)

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        """Return upper bounds, from the recipe alone."""
        plan_estimates.check_gathering(recipe, 0)
        plan = self._views.plan(scene, recipe)
        textures = plan_estimates.texture_bytes(scene)
        return replace(plan, store_bytes=plan.store_bytes + textures, peak_bytes=plan.peak_bytes + textures)

    def prepare(self, scene: Scene) -> None:
        """Build the acceleration structure of the triangles."""
        self._views.prepare(scene)

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        """Return the store's attributes."""
        return {**self._views.attributes(scene, recipe), **texture_attributes(scene)}

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """Return tasks for the lights and each view; then for shards of each view's samples. See `BakeMethod`."""
        return self._views.tasks(stage, scene, recipe, store)

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """Return the visibility arrays of the views; tasks of the first stage create theirs. See `BakeMethod`."""
        return self._views.arrays(stage, scene, recipe, store)

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: TaskStore) -> TaskOutput:
        """Compute a task; deterministic on any machine. See `BakeMethod`."""
        output = self._views.compute(scene, recipe, task, store)
        is_of_scene = task.stage == 0 and not task.group
        return replace(output, arrays={**output.arrays, **texture_arrays(scene)}) if is_of_scene else output
