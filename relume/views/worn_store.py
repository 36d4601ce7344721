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

from relume.bake import StoreReader
from relume.light.gather_rays import Pattern
from relume.memory import Memory
from relume.points import Points
from relume.steps import Steps
from relume.views.leaning import Leant
from relume.views.store_io import pattern_of_material, read_chance, read_eyes, read_seeds, towards

F32 = NDArray[np.float32]
Rows = NDArray[np.int64]

_LEANT = ("normal", "tangent", "uv", "normal_length")
_TRACED = ("visibility", "links", "thrown")
_STEP = 1024  # samples; a tenth of a second's rays


class Tracer(Protocol):
    """Rays of a bake, for normals that it did not know."""

    def check(self) -> None:
        """Raises StoreError where they cannot be traced."""
        ...

    def seen(self, points: Points, before: F32, known: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Find which lights points see. before: normals that they had. known: seen above those. Returns (n, bytes)"""
        ...

    def linked(self, points: Points, wo: F32, pattern: Pattern) -> NDArray[np.uint16]:
        """Find the cells that gather rays of points hit.

        Args:
            points: where they leave. wo: towards the viewer. (n, 3) pattern: of the rays.
        Returns:
            (n, rays)
        """
        ...

    def thrown(self, points: Points) -> NDArray[np.uint8]:
        """Find which lights points see in flat mirrors. points: as they lean. Returns (n, bytes)"""
        ...


@dataclass(frozen=True, eq=False)
class BegunLinks:
    """Cells that gather rays of samples hit, of which some are traced.

    Attributes:
        cell: that each ray hits. (n, rays) uint16
        steps: which samples' are traced.
    """

    cell: NDArray[np.uint16]
    steps: Steps

    @classmethod
    def of(cls, num_samples: int, num_rays: int) -> BegunLinks:
        """Nothing of them."""
        return cls(np.zeros((num_samples, num_rays), np.uint16), Steps.of(num_samples, _STEP))

    def trace(self, linked: Callable[[Rows], NDArray[np.uint16]], cancelled: Callable[[], bool]) -> None:
        """Trace what is left.

        Args:
            linked: finds the cells of some samples. cancelled: asked now and then.
        Raises:
            CancelledError: `cancelled` said so; what was traced stays.
        """

        def some(start: int, stop: int) -> None:
            self.cell[start:stop] = linked(np.arange(start, stop))

        self.steps.work(some, lambda share: None, cancelled, "tracing gather rays")


class WornStore:
    """Another store's samples of one view under other maps; a `StoreReader`.

    Args:
        store: the other. view: number of the view. rows: of it, the row of each sample here. (surface samples,)
        level: of each sample here. (surface samples,) uint8 ratios: of each material's levels.
        leant: samples of materials whose normals are others, by the first row of each; in the order here.
        materials: number of each of those. tracer: of the rays that they lack. memory, key: where these are kept.
    """

    def __init__(
        self,
        store: StoreReader,
        view: int,
        rows: Rows,
        level: NDArray[np.uint8],
        ratios: Sequence[tuple[float, ...]],
        leant: Mapping[int, Leant],
        materials: Mapping[int, int],
        tracer: Tracer,
        memory: Memory,
        key: Any,
    ) -> None:
        self._store, self._view, self._rows, self._level = store, view, rows, level
        self._prefix, self._leant, self._materials = f"views/{view}/", leant, materials
        self._tracer, self._memory, self._key = tracer, memory, key
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
        found = self._reordered(path, start, end)
        for first, leant in self._leant.items():
            a, b = max(start, first), min(end, first + len(leant.normal))
            if a < b:
                self._lean(name, first, slice(a - first, b - first), found[a - start : b - start])
        return found

    def read_some(self, path: str, rows: Rows) -> NDArray[Any]:
        """Some rows of an array of the view, of one material's samples; for those alone rays are traced.

        Args:
            path: of the array. rows: in any order. (k,)
        """
        if len(rows) == 0:
            return self.read(path, 0, 0)
        name, start, end = path.removeprefix(self._prefix), int(rows.min()), int(rows.max()) + 1
        first = next((a for a, of in self._leant.items() if a <= start < a + len(of.normal)), None)
        if first is None or name not in _TRACED:
            return np.asarray(self.read(path, start, end)[rows - start])
        found = self._reordered(path, start, end)[rows - start]
        self._trace(name, first, rows - first, found)
        return found

    def _reordered(self, path: str, start: int, end: int) -> NDArray[Any]:
        rows = self._rows[start:end]
        if len(rows) == 0:
            return self._store.read(path, start, end)
        first = int(rows.min())
        found = self._store.read(path, first, int(rows.max()) + 1)[rows - first]
        if end <= len(self._rows):
            return found
        return np.concatenate([found, self._store.read(path, len(self._rows), end)])  # behind all surfaces

    def _lean(self, name: str, first: int, some: slice, found: NDArray[Any]) -> None:
        """Bring what was read of some samples of a material to their normals. first: row of the material's first."""
        if name in _LEANT:
            found[:] = getattr(self._leant[first], name)[some]
        elif name == "links":
            found[:] = self._links(first)[some]
        elif name in _TRACED:
            self._trace(name, first, self._every(first)[some], found)

    def trace_links(self, first: int, cancelled: Callable[[], bool]) -> None:
        """Trace the gather rays of a material's samples, where it leans; they are kept for a while.

        Args:
            first: row of the material's first sample. cancelled: asked now and then.
        Raises:
            CancelledError: `cancelled` said so; what was traced is there for who asks next.
        """
        if first in self._leant:
            self._links(first, cancelled)

    def _links(self, first: int, cancelled: Callable[[], bool] = lambda: False) -> NDArray[np.uint16]:
        """The cells that they hit, for each of the material's terms. (samples, rays)"""
        pattern, num = self._pattern(first), len(self._leant[first].normal)
        key = *self._key, "links", first
        links = self._memory.passing.keep(key, lambda: BegunLinks.of(num, pattern.num_rays))
        if not links.steps.done.all():
            every = self._every(first)
            points, wo = self._points(first, every), self._wo(first, every)
            links.trace(lambda rows: self._tracer.linked(points.rows(rows), wo[rows], pattern), cancelled)
        return links.cell

    def _every(self, first: int) -> Rows:
        return np.arange(len(self._leant[first].normal))

    def _trace(self, name: str, first: int, chosen: Rows, found: NDArray[Any]) -> None:
        """Trace rays of some samples of a material. found: what was baked; written."""
        if name == "links":
            found[:] = self._tracer.linked(self._points(first, chosen), self._wo(first, chosen), self._pattern(first))
            return
        points = self._points(first, chosen)
        if name == "visibility":
            found[:] = self._tracer.seen(points, self._leant[first].before[chosen], found)
        else:
            found[:] = self._tracer.thrown(points)

    def _wo(self, first: int, chosen: Rows) -> F32:
        """Towards the viewer, of some samples of a material. (n, 3)"""
        eyes = read_eyes(self, self._view, first, first + len(self._leant[first].normal))
        return towards(eyes if len(eyes) == 1 else eyes[chosen], self._points(first, chosen).position)

    def _pattern(self, first: int) -> Pattern:
        return pattern_of_material(self._store, self._view, self._materials[first])

    def _points(self, first: int, chosen: Rows) -> Points:
        """Some samples of a material, counted from its first."""
        leant = self._leant[first]
        start, stop = first, first + len(leant.normal)
        chance = read_chance(self, self._view, start, stop)
        return Points(
            np.asarray(self._reordered(f"{self._prefix}position", start, stop)[chosen], np.float32),
            np.ascontiguousarray(leant.normal[chosen]),
            np.ascontiguousarray(leant.tangent[chosen]),
            read_seeds(self, self._view, start, stop)[chosen],
            chance if len(chance) == 1 else chance[chosen],
        )
