"""A store whose view wears other maps than it was baked with: samples in another order, and rays that lacked, traced.

Bakes trace what lies above the horizon of the normals that they find. Where these lean otherwise, shadow rays are
traced to the lights that come up, and gather rays leave about the normals as they are now.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
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
_SAMPLES_PER_STEP = 1024  # samples; a tenth of a second's rays


class RayTracer(Protocol):
    """Rays of a bake, for normals that it did not know."""

    def check(self) -> None:
        """Raises StoreError where they cannot be traced."""
        ...

    def visibility(self, points: SurfacePoints, baked_normals: F32, baked_bits: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Find which lights points see. baked_normals: before the override.

        baked_bits: visible above those. Returns (n, bytes)
        """
        ...

    def gather_hits(self, points: SurfacePoints, wo: F32, pattern: RayPattern) -> NDArray[np.uint16]:
        """Find the cells that gather rays of points hit.

        Args:
            points: where they leave. wo: towards the viewer. (n, 3) pattern: of the rays.
        Returns:
            (n, rays)
        """
        ...

    def mirror_lights(self, points: SurfacePoints) -> NDArray[np.uint8]:
        """Find which lights points see in flat mirrors. points: as they lean. Returns (n, bytes)"""
        ...


@dataclass(frozen=True, eq=False)
class PartialHits:
    """Cells that gather rays of samples hit, of which some are traced.

    Attributes:
        patch: that each ray hits. (n, rays) uint16
        steps: which samples' are traced.
    """

    patch: NDArray[np.uint16]
    steps: ResumableLoop

    @classmethod
    def empty(cls, num_samples: int, num_rays: int) -> PartialHits:
        """Nothing of them."""
        return cls(np.zeros((num_samples, num_rays), np.uint16), ResumableLoop.start(num_samples, _SAMPLES_PER_STEP))

    def trace(self, trace_rows: Callable[[RowIndices], NDArray[np.uint16]], is_canceled: Callable[[], bool]) -> None:
        """Trace what is left.

        Args:
            trace_rows: finds the cells of some samples. is_canceled: asked now and then.
        Raises:
            CancelledError: `is_canceled` said so; what was traced stays.
        """

        def trace_range(start: int, stop: int) -> None:
            self.patch[start:stop] = trace_rows(np.arange(start, stop))

        self.steps.run(trace_range, lambda share: None, is_canceled, "tracing gather rays")


class MapOverrideStore:
    """Another store's samples of one view under other maps; a `StoreReader`.

    Args:
        store: the other. view: number of the view. rows: of it, the row of each sample here. (surface samples,)
        level: of each sample here. (surface samples,) uint8 ratios: of each material's levels.
        perturbed: samples of materials whose normals are others, by the first row of each; in the order here.
        materials: number of each of those. tracer: of the rays that they lack. cache, key: where these are kept.
    """

    def __init__(
        self,
        store: StoreReader,
        view: int,
        rows: RowIndices,
        level: NDArray[np.uint8],
        ratios: Sequence[tuple[float, ...]],
        perturbed: Mapping[int, PerturbedNormals],
        materials: Mapping[int, int],
        tracer: RayTracer,
        cache: Cache,
        key: Any,
    ) -> None:
        self._store, self._view, self._rows, self._level = store, view, rows, level
        self._prefix, self._perturbed, self._materials = f"views/{view}/", perturbed, materials
        self._tracer, self._cache, self._key = tracer, cache, key
        self._attributes = {**store.attributes, "roughness_levels": list(map(list, ratios))}

    @property
    def attributes(self) -> Mapping[str, Any]:
        """Those of the store, with these levels."""
        return self._attributes

    def shape(self, path: str) -> tuple[int, ...]:
        """Shape of an array."""
        return self._level.shape if path == f"{self._prefix}level" else self._store.shape(path)

    def read(self, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Rows [start, stop) of the array at a path, those of the view's samples as they are here."""
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
        """Some rows of an array of the view, of one material's samples; for those alone rays are traced.

        Args:
            path: of the array. rows: in any order. (k,)
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
        return np.concatenate([values, self._store.read(path, len(self._rows), end)])  # behind all surfaces

    def _apply_override(self, name: str, first: int, rows: slice, values: NDArray[Any]) -> None:
        """Bring what was read of some samples of a material to their normals. first: row of the material's first."""
        if name in _PERTURBED_COLUMNS:
            values[:] = getattr(self._perturbed[first], name)[rows]
        elif name == "gather_hits":
            values[:] = self._gather_hits(first)[rows]
        elif name in _TRACED_COLUMNS:
            self._trace(name, first, self._all_rows(first)[rows], values)

    def trace_gather_rays(self, first: int, is_canceled: Callable[[], bool]) -> None:
        """Trace the gather rays of a material's samples, where it leans; they are kept for a while.

        Args:
            first: row of the material's first sample. is_canceled: asked now and then.
        Raises:
            CancelledError: `is_canceled` said so; what was traced is there for who asks next.
        """
        if first in self._perturbed:
            self._gather_hits(first, is_canceled)

    def _gather_hits(self, first: int, is_canceled: Callable[[], bool] = lambda: False) -> NDArray[np.uint16]:
        """The cells that they hit, for each of the material's terms. (samples, rays)"""
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
        """Trace rays of some samples of a material. found: what was baked; written."""
        if name == "gather_hits":
            values[:] = self._tracer.gather_hits(
                self._surface_points(first, rows), self._wo(first, rows), self._pattern(first)
            )
            return
        surface_points = self._surface_points(first, rows)
        if name == "visibility":
            values[:] = self._tracer.visibility(surface_points, self._perturbed[first].baked_normal[rows], values)
        else:
            values[:] = self._tracer.mirror_lights(surface_points)

    def _wo(self, first: int, rows: RowIndices) -> F32:
        """Towards the viewer, of some samples of a material. (n, 3)"""
        origins = read_ray_origins(self, self._view, first, first + len(self._perturbed[first].normal))
        return view_directions(
            origins if len(origins) == 1 else origins[rows], self._surface_points(first, rows).position
        )

    def _pattern(self, first: int) -> RayPattern:
        return make_material_pattern(self._store, self._view, self._materials[first])

    def _surface_points(self, first: int, rows: RowIndices) -> SurfacePoints:
        """Some samples of a material, counted from its first."""
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
