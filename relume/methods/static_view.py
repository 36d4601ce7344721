"""Stills: what a fixed-view bake of the place where a moving eye rests would hold, made in memory and at once.

Light triangles, gather cells and what those see are in the moving bake already. What the eye alone decides is traced by
the stages of the method `gather`: view samples, the lights that they see, the cells that their gather rays hit. A still
is exact as `gather` is, and all that is made from the bake's light is shared with it.
"""

from __future__ import annotations

import hashlib
import io
import threading
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import CancelledError
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.methods.gather import GatherMethod
from relume.methods.indirect_solver import IndirectSolver
from relume.methods.local_lights import LocalLights
from relume.methods.opened.fixed_views import SampledTransfer
from relume.methods.opened.fixed_views_indirect import BakedIndirectViews
from relume.operators.image_cache import ImageFiles
from relume.scene.custom_camera import with_cameras
from relume.scene.model import Camera, Scene
from relume.store.bake_protocol import Recipe, StoreReader, Task
from relume.views.view import View, open_view

# a fifth of a bake's, both lattices Fibonacci's; what they bring is shared with more neighbours
_RAYS, _GLOSSY_RAYS, _NUM_TENT_PASSES = 123, 34, 2
_ROWS_PER_TASK = 4096  # half a second's work at most: so soon is a still given up
_SAMPLE_STAGE, _SHADOW_STAGE, _HIT_STAGE = 0, 1, 3  # stages of `gather`; the one between them is the bake's


class ExtendedStore:
    """A store in which nothing is written: over it the arrays of one more view, the first; a `TaskStore`."""

    def __init__(self, store: StoreReader, attributes: Mapping[str, Any]) -> None:
        self._store, self._attributes = store, {**store.attributes, **attributes}
        self.arrays: dict[str, NDArray[Any]] = {}

    @property
    def attributes(self) -> Mapping[str, Any]:
        """Those of the store, but for what the view brings."""
        return self._attributes

    def shape(self, path: str) -> tuple[int, ...]:
        """Shape of an array."""
        return self.arrays[path].shape if path in self.arrays else self._store.shape(path)

    def scratch(self) -> IO[bytes]:
        """In memory: a still's view is there all the same."""
        return io.BytesIO()

    def read(self, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Rows [start, stop) of the array at a path."""
        array = self.arrays.get(path)
        return self._store.read(path, start, stop) if array is None else array[start:stop]


@dataclass(frozen=True)
class StaticView(BakedIndirectViews):
    """One view of a moving bake, opened as if it had been baked; what is no view's is the bake's.

    Attributes:
        light_transport: the light of the bake. reflects: whether gather rays were traced; else light comes straight
            alone.
    """

    light_transport: BakedIndirectViews
    reflects: bool

    @classmethod
    def from_store(cls, light_transport: BakedIndirectViews, store: ExtendedStore, reflects: bool) -> StaticView:
        """Open the view that a store has more than the bake.

        Args:
            light_transport: the light of the bake. store: over the bake's. reflects: whether its gather rays are there.
        """
        view = open_view(store, 0, light_transport.cache, light_transport.key)
        bake_fields = {
            bake_field.name: getattr(light_transport, bake_field.name) for bake_field in fields(BakedIndirectViews)
        }
        return cls(
            **{**bake_fields, "store": store, "views": {view.name: view}},
            light_transport=light_transport,
            reflects=reflects,
        )

    @property
    def derived(self) -> ImageFiles:
        """Where images of the default look are kept: among those of others, for eyes are without number."""
        return self.edited

    @cached_property
    def local(self) -> LocalLights:
        """What local lights need."""
        return self.light_transport.local

    @cached_property
    def indirect(self) -> IndirectSolver:
        """Light that gather cells send out."""
        return self.light_transport.indirect

    def subset(
        self, view: View, material: int, sample_indices: NDArray[np.integer], *, has_indirect: bool
    ) -> SampledTransfer:
        """Some of a material's samples, with what gather rays they have. See `FixedViewTransfer`."""
        return super().subset(view, material, sample_indices, has_indirect=has_indirect and self.reflects)


class StaticTracing:
    """A still that is being traced; given up, it goes on from there when it is wanted again.

    Args:
        method: whose stages these are. scene: with the eye among its cameras. recipe: of its view.
        store: that the view's arrays are written to.
    """

    def __init__(self, method: GatherMethod, scene: Scene, recipe: Recipe, store: ExtendedStore) -> None:
        self._method, self._scene, self._recipe, self.store = method, scene, recipe, store
        sampling = Task(_SAMPLE_STAGE, 1, recipe.views[0], 0, 0)
        sampled_arrays = method.compute(scene, recipe, sampling, store).arrays
        store.arrays.update({path: np.asarray(rows) for path, rows in sampled_arrays.items()})
        for stage in (_SHADOW_STAGE, _HIT_STAGE):
            view_specs = (s for s in method.arrays(stage, scene, recipe, store) if s.path.startswith("views/"))
            store.arrays.update({spec.path: np.empty(spec.shape, spec.dtype) for spec in view_specs})
        # seeds of local lights' shadows, too, which need no gather rays
        seeds = store.arrays["views/0/seed"]
        seeds[:] = np.arange(len(seeds))
        shadow_tasks, hit_tasks = (
            list(_split_tasks(method.tasks(k, scene, recipe, store))) for k in (_SHADOW_STAGE, _HIT_STAGE)
        )
        self._tasks, self._num_shadow_tasks = shadow_tasks + hit_tasks, len(shadow_tasks)
        self._num_done, self._lock = 0, threading.Lock()

    @property
    def num_bytes(self) -> int:
        """Memory that the view's arrays hold."""
        return sum(array.nbytes for array in self.store.arrays.values())

    def complete_tracing(self, reflects: bool, progress: ProgressCallback, is_canceled: CancelCheck) -> None:
        """Trace what is left.

        Args:
            reflects: gather rays, too, by far the most of it.
            progress: called with the share done. is_canceled: asked now and then.
        Raises:
            CancelledError: `is_canceled` said so.
        """
        num_tasks = len(self._tasks) if reflects else self._num_shadow_tasks
        while True:
            if is_canceled():
                raise CancelledError("the still was cancelled")
            progress(min(self._num_done / num_tasks, 1.0) if num_tasks else 1.0)
            with self._lock:  # for one task, so that others who want it go on with it as well
                if self._num_done >= num_tasks:
                    return
                self._trace(self._tasks[self._num_done])
                self._num_done += 1

    def _trace(self, task: Task) -> None:
        arrays = self.store.arrays
        for path, rows in self._method.compute(self._scene, self._recipe, task, self.store).arrays.items():
            if path in arrays:
                arrays[path][task.start : task.stop] = rows


class StaticViewBuilder:
    """Makes stills of one moving bake.

    Args:
        light_transport: the light of the bake. scene: that was baked.
    """

    def __init__(self, light_transport: BakedIndirectViews, scene: Scene) -> None:
        self._light_transport, self._scene = light_transport, scene
        self._smooth = GatherMethod(_RAYS, _GLOSSY_RAYS, num_tent_passes=_NUM_TENT_PASSES)
        self._sparse = GatherMethod(_RAYS, _GLOSSY_RAYS, num_tent_passes=_NUM_TENT_PASSES, smooths_edges=False)

    def make_static_view(
        self,
        camera: Camera,
        size: tuple[int, int],
        reflects: bool,
        progress: ProgressCallback,
        is_canceled: CancelCheck,
        *,
        smooths_edges: bool = True,
    ) -> StaticView:
        """Trace what an eye sees, as far as it is not remembered.

        Args:
            camera: the eye. size: width and height, pixels. reflects: with light from other surfaces.
            progress: called with the share done. is_canceled: asked now and then.
            smooths_edges: whether pixels across edges have several samples; else each shows what is at its middle.
        Raises:
            CancelledError: `is_canceled` said so.
            MemoryBudgetError: what is traced is larger than the memory may be.
        """
        cache, name = self._light_transport.cache.transient, _view_name(camera, size, smooths_edges)
        key = self._light_transport.key, "static view", name
        tracing = cache.get_cached(key, StaticTracing)
        if tracing is None:
            new_tracing = self._start_tracing(
                self._smooth if smooths_edges else self._sparse, replace(camera, name=name), size
            )
            tracing = cache.get(key, StaticTracing, new_tracing.num_bytes, lambda: new_tracing)
        tracing.complete_tracing(reflects, progress, is_canceled)
        return StaticView.from_store(self._light_transport, tracing.store, reflects)

    def _start_tracing(self, method: GatherMethod, camera: Camera, size: tuple[int, int]) -> StaticTracing:
        recipe = Recipe(method.name, (camera.name,), size, self._light_transport.num_lights)
        scene = with_cameras(self._scene, [camera])
        store = ExtendedStore(self._light_transport.store, method.attributes(scene, recipe))
        return StaticTracing(method, scene, recipe, store)


def _split_tasks(tasks: Iterable[Task]) -> Iterator[Task]:
    """Those of the view, cut so that one takes no longer than somebody waits who gives a still up."""
    for task in tasks:
        if task.group:
            for start in range(task.start, task.stop, _ROWS_PER_TASK):
                yield replace(task, start=start, stop=min(start + _ROWS_PER_TASK, task.stop))


def _view_name(camera: Camera, size: tuple[int, int], smooths_edges: bool) -> str:
    """A name that no other eye's still has: by it the memory tells their images apart."""
    identity = camera.to_world.tobytes() + repr((camera.yfov, size, smooths_edges)).encode()
    return f"{camera.name} {hashlib.sha256(identity).hexdigest()[:16]}"
