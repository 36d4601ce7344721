"""Store of a view with overridden maps: reordered samples, and rays traced for the overridden normals.

A bake traces lights above the horizon of its normals. For overridden normals, shadow rays are traced to the lights
that rise above the horizon, and gather rays around the new normals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.core.resumable_loop import ResumableLoop
from relume.raytrace.gather_rays import RayPattern
from relume.raytrace.surface_points import SurfacePoints
from relume.store.bake_protocol import StoreReader
from relume.views.normal_override import PerturbedNormals
from relume.views.store_io import (
    make_material_pattern,
    read_alpha_samples,
    read_ray_origins,
    read_seeds,
    view_directions,
)

F32 = NDArray[np.float32]
RowIndices = NDArray[np.int64]

_PERTURBED_COLUMNS = ("normal", "tangent", "uv", "normal_length")
_TRACED_COLUMNS = ("visibility", "gather_hits", "mirror_lights")
_SAMPLES_PER_STEP = 1024  # a tenth of a second of rays


class RayTracer(Protocol):
    """Tracer for the rays of overridden normals."""

    def check(self) -> None:
        """Raise StoreError if they cannot be traced."""
        ...

    def visibility(
        self,
        points: SurfacePoints,
        baked_normals: Shaped[F32, "n 3"],
        baked_bits: Shaped[NDArray[np.uint8], "n bytes"],
    ) -> Shaped[NDArray[np.uint8], "n bytes"]:
        """Find the lights that are visible from points.

        Args:
            points: points with overridden normals. baked_normals: normals before the override.
            baked_bits: visibility of the lights above the horizons of `baked_normals`.
        """
        ...

    def gather_hits(
        self, points: SurfacePoints, wo: Shaped[F32, "n 3"], pattern: RayPattern
    ) -> Shaped[NDArray[np.uint16], "n rays"]:
        """Find the patches that gather rays of points hit. wo: toward the viewer. pattern: pattern of the rays"""
        ...

    def mirror_lights(self, points: SurfacePoints) -> Shaped[NDArray[np.uint8], "n bytes"]:
        """Find the lights that points, with overridden normals, see in planar mirrors."""
        ...


@dataclass(frozen=True, eq=False)
class PartialHits:
    """Gather hits of samples, some of which are traced.

    Attributes:
        patch: index of the patch that each ray hits.
        steps: progress.
    """

    patch: Shaped[NDArray[np.uint16], "n rays"]
    steps: ResumableLoop

    @classmethod
    def empty(cls, num_samples: int, num_rays: int) -> PartialHits:
        """Make hits of which none is traced."""
        return cls(np.zeros((num_samples, num_rays), np.uint16), ResumableLoop.start(num_samples, _SAMPLES_PER_STEP))

    def trace(self, trace_rows: Callable[[RowIndices], NDArray[np.uint16]], is_canceled: Callable[[], bool]) -> None:
        """Trace the remaining samples.

        Args:
            trace_rows: finds the patches of some samples. is_canceled: called regularly.
        Raises:
            CancelledError: `is_canceled` returned true; traced samples stay.
        """

        def trace_range(start: int, stop: int) -> None:
            self.patch[start:stop] = trace_rows(np.arange(start, stop))

        self.steps.run(trace_range, lambda share: None, is_canceled, "tracing gather rays")


class MapOverrideStore:
    """Another store's samples of one view under overridden maps; a `StoreReader`.

    Args:
        store: the other store. view: index of the view.
        rows: row of each sample in the other store. (surface samples,)
        level: roughness level of each sample in this store. (surface samples,) uint8
        level_pairs: levels of each material, see `RoughnessLevels`.
        perturbed: samples with overridden normals, by the first row of their material; in the order of this store.
        materials: index of each of these materials. tracer: tracer for their rays.
        cache, key: cache for traced rays, and key of the bake in it.
    """

    def __init__(
        self,
        store: StoreReader,
        view: int,
        rows: RowIndices,
        level: NDArray[np.uint8],
        level_pairs: Sequence[tuple[tuple[float, float], ...]],
        perturbed: Mapping[int, PerturbedNormals],
        materials: Mapping[int, int],
        tracer: RayTracer,
        cache: Cache,
        key: Any,
    ) -> None:
        self._store, self._view, self._rows, self._level = store, view, rows, level
        self._prefix, self._perturbed, self._materials = f"views/{view}/", perturbed, materials
        self._tracer, self._cache, self._key = tracer, cache, key
        self._attributes = {**store.attributes, "roughness_levels": [list(map(list, pairs)) for pairs in level_pairs]}

    @property
    def attributes(self) -> Mapping[str, Any]:
        """Attributes of the store, with the levels of this one."""
        return self._attributes

    def shape(self, path: str) -> tuple[int, ...]:
        """Shape of an array."""
        return self._level.shape if path == f"{self._prefix}level" else self._store.shape(path)

    def read(self, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read rows [start, stop) of the array at a path, in the order and with the values of this store."""
        name = path.removeprefix(self._prefix)
        if name == path or "/" in name:
            return self._store.read(path, start, stop)
        if name == "level":
            return self._level[start:stop]
        end = self._store.shape(path)[0] if stop is None else stop
        values = self._reordered(path, start, end)
        for first, perturbed in self._perturbed.items():
            a, b = max(start, first), min(end, first + len(perturbed.normal))
            if a < b:
                self._apply_override(name, first, slice(a - first, b - first), values[a - start : b - start])
        return values

    def read_rows(self, path: str, rows: RowIndices) -> NDArray[Any]:
        """Read some rows of an array of the view, of one material's samples; rays are traced only for those.

        Args:
            path: path of the array. rows: in any order. (k,)
        """
        if len(rows) == 0:
            return self.read(path, 0, 0)
        name, start, end = path.removeprefix(self._prefix), int(rows.min()), int(rows.max()) + 1
        first = next(
            (
                material_start
                for material_start, perturbed in self._perturbed.items()
                if material_start <= start < material_start + len(perturbed.normal)
            ),
            None,
        )
        if first is None or name not in _TRACED_COLUMNS:
            return np.asarray(self.read(path, start, end)[rows - start])
        values = self._reordered(path, start, end)[rows - start]
        self._trace(name, first, rows - first, values)
        return values

    def _reordered(self, path: str, start: int, end: int) -> NDArray[Any]:
        rows = self._rows[start:end]
        if len(rows) == 0:
            return self._store.read(path, start, end)
        first = int(rows.min())
        values = self._store.read(path, first, int(rows.max()) + 1)[rows - first]
        if end <= len(self._rows):
            return values
        return np.concatenate([values, self._store.read(path, len(self._rows), end)])  # background samples

    def _apply_override(self, name: str, first: int, rows: slice, values: NDArray[Any]) -> None:
        """Replace values of some samples of a material. first: first row of the material"""
        if name in _PERTURBED_COLUMNS:
            values[:] = getattr(self._perturbed[first], name)[rows]
        elif name == "gather_hits":
            gather_hits = self._gather_hits(first)[rows]
            values[:, : gather_hits.shape[1]] = gather_hits
        elif name in _TRACED_COLUMNS:
            self._trace(name, first, self._all_rows(first)[rows], values)

    def trace_gather_rays(self, first: int, is_canceled: Callable[[], bool]) -> None:
        """Trace the gather rays of a material's samples with overridden normals; they are cached.

        Args:
            first: first row of the material. is_canceled: called regularly.
        Raises:
            CancelledError: `is_canceled` returned true; traced rays stay cached.
        """
        if first in self._perturbed:
            self._gather_hits(first, is_canceled)

    def _gather_hits(self, first: int, is_canceled: Callable[[], bool] = lambda: False) -> NDArray[np.uint16]:
        """Patches that gather rays hit, shared by all terms of the material. (samples, rays)"""
        pattern, num = self._pattern(first), len(self._perturbed[first].normal)
        key = *self._key, "gather hits", first
        partial_hits = self._cache.transient.get_value(key, lambda: PartialHits.empty(num, pattern.num_rays))
        if not partial_hits.steps.done.all():
            all_rows = self._all_rows(first)
            surface_points, wo = self._surface_points(first, all_rows), self._wo(first, all_rows)
            partial_hits.trace(
                lambda rows: self._tracer.gather_hits(surface_points.rows(rows), wo[rows], pattern), is_canceled
            )
        return partial_hits.patch

    def _all_rows(self, first: int) -> RowIndices:
        return np.arange(len(self._perturbed[first].normal))

    def _trace(self, name: str, first: int, rows: RowIndices, values: NDArray[Any]) -> None:
        """Trace rays of some samples of a material. values: baked values; overwritten"""
        if name == "gather_hits":
            pattern = self._pattern(first)
            traced_hits = self._tracer.gather_hits(self._surface_points(first, rows), self._wo(first, rows), pattern)
            values[:, : pattern.num_rays] = traced_hits
            return
        surface_points = self._surface_points(first, rows)
        if name == "visibility":
            values[:] = self._tracer.visibility(surface_points, self._perturbed[first].baked_normal[rows], values)
        else:
            values[:] = self._tracer.mirror_lights(surface_points)

    def _wo(self, first: int, rows: RowIndices) -> F32:
        """Directions to the viewer, of some samples of a material. (n, 3)"""
        origins = read_ray_origins(self, self._view, first, first + len(self._perturbed[first].normal))
        return view_directions(
            origins if len(origins) == 1 else origins[rows], self._surface_points(first, rows).position
        )

    def _pattern(self, first: int) -> RayPattern:
        return make_material_pattern(self._store, self._view, self._materials[first])

    def _surface_points(self, first: int, rows: RowIndices) -> SurfacePoints:
        """Points of some samples of a material, counted from its first."""
        perturbed = self._perturbed[first]
        start, stop = first, first + len(perturbed.normal)
        alpha_samples = read_alpha_samples(self, self._view, start, stop)
        return SurfacePoints(
            np.asarray(self._reordered(f"{self._prefix}position", start, stop)[rows], np.float32),
            np.ascontiguousarray(perturbed.normal[rows]),
            np.ascontiguousarray(perturbed.tangent[rows]),
            read_seeds(self, self._view, start, stop)[rows],
            alpha_samples if len(alpha_samples) == 1 else alpha_samples[rows],
        )
