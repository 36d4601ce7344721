"""The light of a bake through glass that a look edits: its patches, traced again by the stages that baked them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import count
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from relume.core.digest import digest
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.live.opened.extended_store import ExtendedStore, split_tasks, write_tasks
from relume.live.opened.fixed_views import BakedFixedViews
from relume.live.opened.fixed_views_indirect import BakedIndirectViews
from relume.live.opened.stored_patches import read_patches
from relume.methods.direct import DirectMethod
from relume.methods.gather import GatherMethod
from relume.raytrace.alpha_test import collect_alpha_masks
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe

ViewMethod = GatherMethod | DirectMethod
Transport = TypeVar("Transport", bound=BakedFixedViews)

_RAY_STAGE = 3  # of `gather`
_ACCELERATION_BYTES = 300  # of a triangle
_PATCHES_PER_TASK = 256  # at most half a second of work, which bounds the time to cancel


def light_through_glass(
    light_transport: Transport,
    method: ViewMethod,
    scene: Scene,
    progress: ProgressCallback,
    is_canceled: CancelCheck,
) -> Transport:
    """Return the light of a bake as if its scene had other glass, without views; the same if its shadows are the same.

    Args:
        light_transport: the light of the bake. method: traces its rays. scene: with that glass.
        progress: called with the completed fraction. is_canceled: polled.
    Raises:
        CancelledError: `is_canceled` returned true.
    """
    masks = collect_alpha_masks(scene.materials)
    assert masks is not None  # there is glass
    if np.array_equal(masks.rules, light_transport.store.read("alpha_masks/rules")):  # only camera rays differ
        return light_transport

    cache, key = light_transport.cache.transient, (light_transport.key, "light through glass", masks.rules.tobytes())
    traced = cache.get_cached(key, _TracedLight)
    if traced is None:
        light = _trace(light_transport, method, scene, masks.rules, progress, is_canceled)
        own_arrays = light.store.arrays.values() if isinstance(light.store, ExtendedStore) else ()
        num_bytes = sum(array.nbytes for array in own_arrays) + _ACCELERATION_BYTES * len(light.local.faces)
        traced = cache.get(key, _TracedLight, num_bytes, lambda: _TracedLight(light, num_bytes))
    traced_light: Transport = traced.light
    return traced_light


@dataclass(frozen=True)
class _TracedLight:
    """Light through edited glass, an entry of the cache.

    Attributes:
        num_bytes: memory in use, with that of an acceleration structure, which is built when it is needed.
    """

    light: Any
    num_bytes: int


def _trace(
    light_transport: Transport,
    method: ViewMethod,
    scene: Scene,
    rules: NDArray[np.float32],
    progress: ProgressCallback,
    is_canceled: CancelCheck,
) -> Transport:
    """Return the light of a bake through other glass. rules: of alpha masks; all others as in `light_through_glass`"""
    store = ExtendedStore(light_transport.store, {"views": []})
    store.arrays["alpha_masks/rules"] = rules
    key = f"{light_transport.key}/glass-{digest(rules.tobytes())[:16]}"
    fields: dict[str, Any] = {"store": store, "key": key, "views": {}}
    if isinstance(light_transport, BakedIndirectViews):
        assert isinstance(method, GatherMethod)
        _trace_patches(method, scene, store, progress, is_canceled)
        return replace(light_transport, **fields, patches=read_patches(store))
    return replace(light_transport, **fields)


def _trace_patches(
    method: GatherMethod, scene: Scene, store: ExtendedStore, progress: ProgressCallback, is_canceled: CancelCheck
) -> None:
    """Trace the rays of all patches."""
    width, height = store.attributes["size"]
    recipe = Recipe(method.name, (), (width, height), store.attributes["num_lights"])
    store.allocate(method.arrays(_RAY_STAGE, scene, recipe, store))
    tasks = list(split_tasks(method.tasks(_RAY_STAGE, scene, recipe, store), _PATCHES_PER_TASK))
    num_done = count(1)
    write_tasks(
        store,
        tasks,
        lambda task: method.compute(scene, recipe, task, store),
        lambda: progress(next(num_done) / len(tasks)),
        is_canceled,
    )
