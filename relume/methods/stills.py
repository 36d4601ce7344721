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

from relume.bake import Recipe, StoreReader, Task
from relume.errors import CancelledError
from relume.methods.gather import GatherMethod
from relume.methods.local_lights import LocalLights
from relume.methods.opened.baked_views import FewSamples
from relume.methods.opened.bounced_views import BouncedViews
from relume.methods.reflected import Reflected
from relume.operators.image_files import ImageFiles
from relume.picture.jobs import Cancelled, Progress
from relume.scene.model import Camera, Scene
from relume.scene.placed_camera import with_cameras
from relume.views.view import View, open_view

# a fifth of a bake's, both lattices Fibonacci's; what they bring is shared with more neighbours
_RAYS, _GLOSSY_RAYS, _TENTS = 123, 34, 2
_ROWS_A_TASK = 4096  # half a second's work at most: so soon is a still given up
_SAMPLES, _SHADOWS, _LINKS = 0, 1, 3  # stages of `gather`; the one between them is the bake's


class StoreWithView:
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
        found = self.arrays.get(path)
        return self._store.read(path, start, stop) if found is None else found[start:stop]


@dataclass(frozen=True)
class Still(BouncedViews):
    """One view of a moving bake, opened as if it had been baked; what is no view's is the bake's.

    Attributes:
        lit: the light of the bake. reflects: whether gather rays were traced; else light comes straight alone.
    """

    lit: BouncedViews
    reflects: bool

    @classmethod
    def of(cls, lit: BouncedViews, store: StoreWithView, reflects: bool) -> Still:
        """Open the view that a store has more than the bake.

        Args:
            lit: the light of the bake. store: over the bake's. reflects: whether its gather rays are there.
        """
        view = open_view(store, 0, lit.memory, lit.key)
        of_bake = {one.name: getattr(lit, one.name) for one in fields(BouncedViews)}
        return cls(**{**of_bake, "store": store, "views": {view.name: view}}, lit=lit, reflects=reflects)

    @property
    def derived(self) -> ImageFiles:
        """Where images of the default look are kept: among those of others, for eyes are without number."""
        return self.edited

    @cached_property
    def local(self) -> LocalLights:
        """What local lights need."""
        return self.lit.local

    @cached_property
    def reflected(self) -> Reflected:
        """Light that gather cells send out."""
        return self.lit.reflected

    def some(self, view: View, material: int, chosen: NDArray[np.integer], *, reflects: bool) -> FewSamples:
        """Some of a material's samples, with what gather rays they have. See `Transfer`."""
        return super().some(view, material, chosen, reflects=reflects and self.reflects)


class Tracing:
    """A still that is being traced; given up, it goes on from there when it is wanted again.

    Args:
        method: whose stages these are. scene: with the eye among its cameras. recipe: of its view.
        store: that the view's arrays are written to.
    """

    def __init__(self, method: GatherMethod, scene: Scene, recipe: Recipe, store: StoreWithView) -> None:
        self._method, self._scene, self._recipe, self.store = method, scene, recipe, store
        sampling = Task(_SAMPLES, 1, recipe.views[0], 0, 0)
        found = method.compute(scene, recipe, sampling, store).arrays
        store.arrays.update({path: np.asarray(rows) for path, rows in found.items()})
        for stage in (_SHADOWS, _LINKS):
            of_view = (s for s in method.arrays(stage, scene, recipe, store) if s.path.startswith("views/"))
            store.arrays.update({spec.path: np.empty(spec.shape, spec.dtype) for spec in of_view})
        # seeds of local lights' shadows, too, which need no gather rays
        seeds = store.arrays["views/0/number"]
        seeds[:] = np.arange(len(seeds))
        shadows, links = (list(_shortened(method.tasks(k, scene, recipe, store))) for k in (_SHADOWS, _LINKS))
        self._tasks, self._num_straight = shadows + links, len(shadows)
        self._done, self._lock = 0, threading.Lock()

    @property
    def num_bytes(self) -> int:
        """Memory that the view's arrays hold."""
        return sum(array.nbytes for array in self.store.arrays.values())

    def finish(self, reflects: bool, progress: Progress, cancelled: Cancelled) -> None:
        """Trace what is left.

        Args:
            reflects: gather rays, too, by far the most of it.
            progress: called with the share done. cancelled: asked now and then.
        Raises:
            CancelledError: `cancelled` said so.
        """
        num_tasks = len(self._tasks) if reflects else self._num_straight
        while True:
            if cancelled():
                raise CancelledError("the still was cancelled")
            progress(min(self._done / num_tasks, 1.0) if num_tasks else 1.0)
            with self._lock:  # for one task, so that others who want it go on with it as well
                if self._done >= num_tasks:
                    return
                self._trace(self._tasks[self._done])
                self._done += 1

    def _trace(self, task: Task) -> None:
        arrays = self.store.arrays
        for path, rows in self._method.compute(self._scene, self._recipe, task, self.store).arrays.items():
            if path in arrays:
                arrays[path][task.start : task.stop] = rows


class Stills:
    """Makes stills of one moving bake.

    Args:
        lit: the light of the bake. scene: that was baked.
    """

    def __init__(self, lit: BouncedViews, scene: Scene) -> None:
        self._lit, self._scene = lit, scene
        self._smooth = GatherMethod(_RAYS, _GLOSSY_RAYS, tents=_TENTS)
        self._sparse = GatherMethod(_RAYS, _GLOSSY_RAYS, tents=_TENTS, smooths_edges=False)

    def make(
        self,
        camera: Camera,
        size: tuple[int, int],
        reflects: bool,
        progress: Progress,
        cancelled: Cancelled,
        *,
        smooths_edges: bool = True,
    ) -> Still:
        """Trace what an eye sees, as far as it is not remembered.

        Args:
            camera: the eye. size: width and height, pixels. reflects: with light from other surfaces.
            progress: called with the share done. cancelled: asked now and then.
            smooths_edges: whether pixels across edges have several samples; else each shows what is at its middle.
        Raises:
            CancelledError: `cancelled` said so.
            MemoryBudgetError: what is traced is larger than the memory may be.
        """
        memory, name = self._lit.memory.passing, _name_of(camera, size, smooths_edges)
        key = self._lit.key, "still", name
        tracing = memory.find(key, Tracing)
        if tracing is None:
            begun = self._begin(self._smooth if smooths_edges else self._sparse, replace(camera, name=name), size)
            tracing = memory.get(key, Tracing, begun.num_bytes, lambda: begun)
        tracing.finish(reflects, progress, cancelled)
        return Still.of(self._lit, tracing.store, reflects)

    def _begin(self, method: GatherMethod, camera: Camera, size: tuple[int, int]) -> Tracing:
        recipe = Recipe(method.name, (camera.name,), size, self._lit.num_lights)
        scene = with_cameras(self._scene, [camera])
        store = StoreWithView(self._lit.store, method.attributes(scene, recipe))
        return Tracing(method, scene, recipe, store)


def _shortened(tasks: Iterable[Task]) -> Iterator[Task]:
    """Those of the view, cut so that one takes no longer than somebody waits who gives a still up."""
    for task in tasks:
        if task.view:
            for start in range(task.start, task.stop, _ROWS_A_TASK):
                yield replace(task, start=start, stop=min(start + _ROWS_A_TASK, task.stop))


def _name_of(camera: Camera, size: tuple[int, int], smooths_edges: bool) -> str:
    """A name that no other eye's still has: by it the memory tells their images apart."""
    what = camera.to_world.tobytes() + repr((camera.yfov, size, smooths_edges)).encode()
    return f"{camera.name} {hashlib.sha256(what).hexdigest()[:16]}"
