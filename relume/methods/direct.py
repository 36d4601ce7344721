"""Method `direct`: environment light, fixed views, shadows, no bounces (Ben-Artzi 2006).

A store of it holds what `relume.methods.view_stages` bakes, and nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from relume.core.cache import Cache
from relume.methods import plan_estimates
from relume.methods.opened.described import read_fields
from relume.methods.opened.fixed_views import BakedFixedViews
from relume.methods.view_stages import SampledViews
from relume.scene.model import Scene
from relume.store.bake_protocol import ArraySpec, Plan, Recipe, StoreReader, Task, TaskOutput, TaskStore


class DirectMethod:
    """Implements `relume.methods.base.TransferMethod`."""

    name = "direct"
    stages = SampledViews.stages

    def __init__(self) -> None:
        self._views = SampledViews()

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        """Upper bounds from the recipe alone."""
        plan_estimates.check_gathering(recipe, 0)
        return self._views.plan(scene, recipe)

    def prepare(self, scene: Scene) -> None:
        """Build the triangles' search tree."""
        self._views.prepare(scene)

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        """What opening the store needs besides its arrays."""
        return self._views.attributes(scene, recipe)

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """The lights and each view; then whole shards of each view's surface samples. See `BakeMethod`."""
        return self._views.tasks(stage, scene, recipe, store)

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """The visibility of each view; the arrays of the first stage are made by its tasks. See `BakeMethod`."""
        return self._views.arrays(stage, scene, recipe, store)

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: TaskStore) -> TaskOutput:
        """One task; nothing is random, so the same task gives the same bits anywhere. See `BakeMethod`."""
        return self._views.compute(scene, recipe, task, store)

    def open(self, store: StoreReader, key: str, cache: Cache) -> BakedFixedViews:
        """Views lit by the environment and by local lights. See `TransferMethod`."""
        return BakedFixedViews(**read_fields(store, key, cache))
