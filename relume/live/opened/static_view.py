"""Static views: a fixed view traced in memory when a free camera stops, or when a look edits glass.

Light triangles, patches and their visibility are in the bake already. Only the view-dependent part is traced, by the
stages of the method `gather`: view samples, their visible lights, their gather hits. A static view is as exact as
`gather`, and shares all results computed from the bake's light. Glass that a look edits stops other rays, so the rays
of patches are traced again as well, once for all views (`relume.live.opened.edited_glass`).
"""

from __future__ import annotations

import hashlib
import threading
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import chain
from typing import Any, Self, cast

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.live.fixed_camera.protocols import OpenBake
from relume.live.opened.edited_glass import ViewMethod, light_through_glass
from relume.live.opened.extended_store import ExtendedStore, split_tasks, write_tasks
from relume.live.opened.fixed_views import BakedFixedViews
from relume.live.opened.fixed_views_indirect import BakedIndirectViews
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.live.opened.indirect_solver import IndirectSolver
from relume.live.opened.lobe_light import LobeTracer
from relume.live.opened.local_lights import LocalLights
from relume.live.opened.own_images import OwnImages
from relume.live.opened.samples import SelectedSamples
from relume.look.glass import GlassOfLook, with_glass
from relume.look.object_materials import ObjectMaterials, with_object_materials
from relume.methods.direct import DirectMethod
from relume.methods.gather import GatherMethod
from relume.operators.image_cache import ImageFiles
from relume.scene.custom_camera import with_cameras
from relume.scene.model import Camera, Scene
from relume.store.bake_protocol import Recipe, Task, TaskOutput
from relume.views.sample_seeds import make_seeds
from relume.views.view import View, open_view

_RAYS, _GLOSSY_RAYS, _DIFFUSE_RAYS = 123, 34, 89  # a third or less of a bake's; lattices of Fibonacci sizes
_ROWS_PER_TASK = 4096  # at most half a second of work, which bounds the time to cancel
_TASKS_PER_BATCH = 32  # until another caller has its turn
_SAMPLE_STAGE, _SHADOW_STAGE, _HIT_STAGE = 0, 1, 3  # stages of `gather`; the stage between these is in the bake
_LIGHT_FRACTION = 0.3  # of the progress of a view with edited glass; the rest is the view


class _OverBake:
    """A view traced in memory, which shares light and tracers with its bake.

    Attributes:
        light_transport: the light of the bake.
    """

    light_transport: BakedFixedViews
    edited: ImageFiles

    @property
    def derived(self) -> ImageFiles:
        """Images of the default look: bounded like those of other looks, since the number of cameras is not."""
        return self.edited

    @cached_property
    def local(self) -> LocalLights:
        """Local lights of the scene."""
        return self.light_transport.local

    @cached_property
    def own_images(self) -> OwnImages:
        """The scene's textures as images of looks."""
        return self.light_transport.own_images

    @cached_property
    def lobe_tracer(self) -> LobeTracer:
        """Traces lobe rays."""
        return self.light_transport.lobe_tracer


@dataclass(frozen=True)
class DirectView(_OverBake, BakedFixedViews):
    """One view of a bake with direct illumination, traced in memory through edited glass."""

    light_transport: BakedFixedViews


@dataclass(frozen=True)
class StaticView(_OverBake, BakedIndirectViews):
    """One static view over a free-camera bake, opened like a fixed view; shares everything that is not of the view.

    Attributes:
        light_transport: the light of the bake. reflects: True if gather rays were traced; else direct illumination
            only.
    """

    light_transport: BakedIndirectViews
    reflects: bool

    @classmethod
    def from_bake(
        cls, light_transport: BakedIndirectViews, store: ExtendedStore, reflects: bool, glass: GlassOfLook
    ) -> StaticView:
        """Open the view of an extended store.

        Args:
            light_transport: the light of the bake. store: over the bake's. reflects: True if it has gather rays.
            glass: that its camera rays have met.
        """
        view = open_view(store, 0, light_transport.cache, light_transport.key)
        own_fields = {"store": store, "views": {view.name: view}, "glass": glass}
        return cls(
            **{**_bake_fields(light_transport, BakedIndirectViews), **own_fields},
            light_transport=light_transport,
            reflects=reflects,
        )

    @cached_property
    def indirect(self) -> IndirectSolver:
        """Solver for the outgoing light of the patches."""
        return self.light_transport.indirect

    def selected_samples(
        self, view: View, material: int, sample_indices: Shaped[NDArray[np.integer], " m"], *, has_indirect: bool
    ) -> SelectedSamples:
        """Select samples of a material, with gather rays if traced. See `FixedViewTransfer`."""
        has_rays = has_indirect and self.reflects
        return super().selected_samples(view, material, sample_indices, has_indirect=has_rays)


class StaticTracing:
    """A static view that is being traced; after cancellation it resumes from there.

    Args:
        method: with these stages. scene: with the camera added. recipe: recipe of its view.
        store: for the view's arrays.
    """

    def __init__(self, method: ViewMethod, scene: Scene, recipe: Recipe, store: ExtendedStore) -> None:
        self._method, self._scene, self._recipe, self.store = method, scene, recipe, store
        sampling = Task(_SAMPLE_STAGE, 1, recipe.views[0], 0, 0)
        sampled_arrays = method.compute(scene, recipe, sampling, store).arrays
        store.arrays.update({path: np.asarray(rows) for path, rows in sampled_arrays.items()})
        view_stages = [stage for stage in (_SHADOW_STAGE, _HIT_STAGE) if stage < len(method.stages)]
        for stage in view_stages:
            store.allocate(s for s in method.arrays(stage, scene, recipe, store) if s.path.startswith("views/"))
        # includes the seeds of local lights' shadows, which do not need gather rays
        if (seeds := store.arrays.get("views/0/seed")) is not None:
            seeds[:] = make_seeds(store, 0, recipe.size[0], 0, len(seeds))
        shadow_tasks, *hit_tasks = (
            list(split_tasks((t for t in method.tasks(k, scene, recipe, store) if t.group), _ROWS_PER_TASK))
            for k in view_stages
        )
        self._tasks, self._num_shadow_tasks = [*shadow_tasks, *chain(*hit_tasks)], len(shadow_tasks)
        self._num_done, self._lock = 0, threading.Lock()

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        return sum(array.nbytes for array in self.store.arrays.values())

    def complete_tracing(self, reflects: bool, progress: ProgressCallback, is_canceled: CancelCheck) -> None:
        """Trace the remaining tasks.

        Args:
            reflects: includes gather rays, which take most of the time.
            progress: called with the completed fraction. is_canceled: polled.
        Raises:
            CancelledError: `is_canceled` returned True.
        """
        num_tasks = len(self._tasks) if reflects else self._num_shadow_tasks

        def compute(task: Task) -> TaskOutput:
            return self._method.compute(self._scene, self._recipe, task, self.store)

        def report() -> None:
            self._num_done += 1
            progress(self._num_done / num_tasks)

        while self._num_done < num_tasks:
            with self._lock:  # concurrent callers share the work
                batch = self._tasks[self._num_done : min(self._num_done + _TASKS_PER_BATCH, num_tasks)]
                write_tasks(self.store, batch, compute, report, is_canceled)
        progress(1.0)


class StaticViewBuilder:
    """Traces static views of one bake.

    Args:
        light_transport: the light of the bake. scene: that was baked.
    """

    def __init__(self, light_transport: BakedFixedViews, scene: Scene) -> None:
        self._light_transport, self._scene = light_transport, scene
        self._smooth, self._sparse = (
            GatherMethod(_RAYS, _GLOSSY_RAYS, _DIFFUSE_RAYS, smooths_edges=smooths_edges)
            if isinstance(light_transport, BakedIndirectViews)
            else DirectMethod(smooths_edges=smooths_edges)
            for smooths_edges in (True, False)
        )

    @classmethod
    def from_bake(cls, bake: OpenBake, scene: Scene) -> Self:
        """Make the builder of any open bake. scene: that was baked"""
        fixed = bake.light_transport if isinstance(bake, BakedFreeCamera) else bake
        return cls(cast("BakedFixedViews", fixed), scene)

    def make_static_view(
        self,
        camera: Camera,
        size: tuple[int, int],
        reflects: bool,
        progress: ProgressCallback,
        is_canceled: CancelCheck,
        *,
        smooths_edges: bool = True,
        glass: GlassOfLook | None = None,
        object_materials: ObjectMaterials = (),
    ) -> BakedFixedViews:
        """Trace a static view, as far as it is not cached.

        Args:
            camera: the pose. size: width and height, pixels. reflects: includes indirect illumination.
            progress: called with the completed fraction. is_canceled: polled.
            smooths_edges: whether pixels on edges have several samples; else each has one at its center.
            glass: that rays meet; None: the scene's own. object_materials: of the look.
        Raises:
            CancelledError: `is_canceled` returned True.
            MemoryBudgetError: the view exceeds the memory budget.
        """
        light_transport = self._light_transport.with_object_materials(object_materials)
        scene = with_object_materials(self._scene, object_materials)
        method = self._smooth if smooths_edges else self._sparse
        glass = light_transport.glass if glass is None else glass
        if glass != light_transport.glass:
            scene = with_glass(scene, glass)
            light_transport = light_through_glass(
                light_transport, method, scene, _part(progress, 0, _LIGHT_FRACTION), is_canceled
            )
            progress = _part(progress, _LIGHT_FRACTION, 1)
        name = _view_name(camera, size, smooths_edges, scene)
        key = light_transport.key, "static view", name
        cache = light_transport.cache.transient
        tracing = cache.get_cached(key, StaticTracing)
        if tracing is None:
            new_tracing = _start_tracing(method, light_transport, scene, replace(camera, name=name), size, is_canceled)
            tracing = cache.get(key, StaticTracing, new_tracing.num_bytes, lambda: new_tracing)
        tracing.complete_tracing(reflects, progress, is_canceled)
        if isinstance(light_transport, BakedIndirectViews):
            return StaticView.from_bake(light_transport, tracing.store, reflects, glass)
        view = open_view(tracing.store, 0, light_transport.cache, light_transport.key)
        own_fields = {"store": tracing.store, "views": {view.name: view}, "glass": glass}
        return DirectView(
            **{**_bake_fields(light_transport, BakedFixedViews), **own_fields}, light_transport=light_transport
        )


def _bake_fields(bake: BakedFixedViews, kind: type[BakedFixedViews]) -> dict[str, Any]:
    """Return the fields of a bake. kind: that declares them"""
    return {field.name: getattr(bake, field.name) for field in fields(kind)}


def _start_tracing(
    method: ViewMethod,
    light_transport: BakedFixedViews,
    scene: Scene,
    camera: Camera,
    size: tuple[int, int],
    is_canceled: CancelCheck,
) -> StaticTracing:
    """Find the samples of a view. Raises CancelledError if `is_canceled` returned true."""
    recipe = Recipe(method.name, (camera.name,), size, light_transport.num_lights)
    scene = with_cameras(scene, [camera])
    store = ExtendedStore(light_transport.store, method.attributes(scene, recipe))
    store.is_canceled = is_canceled
    tracing = StaticTracing(method, scene, recipe, store)
    store.is_canceled = lambda: False  # each task of the rest is short
    return tracing


def _part(progress: ProgressCallback, start: float, stop: float) -> ProgressCallback:
    """Report the progress of a part of the work, from one fraction of all to another."""
    return lambda share: progress(start + (stop - start) * share)


def _view_name(camera: Camera, size: tuple[int, int], smooths_edges: bool, scene: Scene) -> str:
    """Return a unique name of a camera's static view, which identifies its images in the cache."""
    identity = (
        camera.to_world.tobytes()
        + repr((camera.yfov, camera.near, camera.lens, size, smooths_edges, scene.id)).encode()
    )
    return f"{camera.name} {hashlib.sha256(identity).hexdigest()[:16]}"
