"""The bake protocol: plan (pure), tasks, compute (pure), and the interfaces for workers.

bake (worker, once) → freeze (server, on prepare) → frame (server, per edit). `relume.methods.registry` lists how
methods bake, `relume.live.opened.openers` how their bakes open; the contract suite in tests/contract tests both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import IO, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.scene.custom_camera import CustomCamera, with_cameras
from relume.scene.model import Scene


class RowSource(Protocol):
    """Rows that may exceed memory: an array, or an object that reads them on request."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of all rows together."""
        ...

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of an element."""
        ...

    def __getitem__(self, rows: slice, /) -> NDArray[Any]:
        """Read consecutive rows."""
        ...


Arrays = Mapping[str, RowSource]


@dataclass(frozen=True)
class Recipe:
    """Input of a bake. The same scene, recipe and code give the same store, bit for bit.

    Attributes:
        method: name of a transfer method.
        views: camera names, in order.
        size: width and height in pixels.
        num_lights: number of environment triangles.
        relightable: choose the triangles for any environment, not for the scene's own.
        cameras: the cameras of `views` that users placed; the others belong to the scene.
        num_probes: surface probes for a free camera; methods with fixed cameras have none.
        num_patches: surface patches for indirect light.
        gather_rays: gather rays per view sample or probe. None: the method chooses; `direct` has none.
    """

    method: str
    views: tuple[str, ...]
    size: tuple[int, int]
    num_lights: int
    relightable: bool = False
    cameras: tuple[CustomCamera, ...] = ()
    num_probes: int = 50_000
    num_patches: int | None = None
    gather_rays: int | None = None

    def add_cameras(self, scene: Scene) -> Scene:
        """Add the cameras of this recipe to a scene; the method plans and bakes the result."""
        return with_cameras(scene, [placed_camera.camera for placed_camera in self.cameras]) if self.cameras else scene


@dataclass(frozen=True)
class ArraySpec:
    """One Zarr array of a store.

    Attributes:
        path: path inside the store, e.g. "views/front/visibility".
        chunks: unit of reading. shards: unit of writing; a task owns whole shards.
    """

    path: str
    shape: tuple[int, ...]
    dtype: str
    chunks: tuple[int, ...]
    shards: tuple[int, ...]


@dataclass(frozen=True)
class Task:
    """A piece of a bake that one process computes alone.

    Attributes:
        stage: index into `BakeMethod.stages`; a stage starts when the previous one is complete.
        index: position within the stage; (stage, index) identifies the task.
        group: view of the task, "" for none.
        start, stop: rows of the stage's arrays that the task owns, shard-aligned.
    """

    stage: int
    index: int
    group: str
    start: int
    stop: int


@dataclass(frozen=True)
class Plan:
    """Cost of a bake before anything is traced. Upper bounds unless noted.

    Attributes:
        num_rays: shadow and camera rays.
        store_bytes: bytes on disk, uncompressed.
        disk_bytes: bytes on disk, extrapolated from a compressed sample; no bound. 0 without a sample: use
            `store_bytes`.
        scratch_bytes: temporary files during the bake.
        peak_bytes: memory of one worker process.
        lone_bytes: part of `peak_bytes` that only one process needs at a time, for a step with a single task.
        work_s: approximate time on one core, for comparing plans. 0 in older plans.
    """

    num_view_samples: int
    num_rays: int
    store_bytes: int
    peak_bytes: int
    lone_bytes: int = 0
    work_s: float = 0.0
    disk_bytes: int = 0
    scratch_bytes: int = 0

    @property
    def planned_bytes(self) -> int:
        """Expected size of the finished store on disk."""
        return self.disk_bytes or self.store_bytes


@dataclass(frozen=True)
class TaskOutput:
    """Result of a task: rows [start, stop) of each array, and its cost.

    Attributes:
        arrays: the task's rows, by array path.
        num_rays: number of traced rays. trace_s: seconds in the tracing kernels alone.
    """

    arrays: Arrays
    num_rays: int
    trace_s: float


class StoreReader(Protocol):
    """Reader for the output of earlier stages; raises `ChunkDamagedError` if a checksum fails."""

    def read(self, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read rows [start, stop) of the array at a path inside the store; `stop` None for all further rows."""
        ...

    def shape(self, path: str) -> tuple[int, ...]:
        """Shape of an array."""
        ...

    @property
    def attributes(self) -> Mapping[str, Any]:
        """The store's root attributes."""
        ...


class TaskStore(StoreReader, Protocol):
    """Input of a task, and scratch files for data that exceeds memory."""

    def scratch(self) -> IO[bytes]:
        """Open a temporary file for writing and reading; it is deleted when it is closed."""
        ...

    def check_canceled(self) -> None:
        """Raise CancelledError if the result is no longer needed; long tasks call this regularly."""
        ...


class BakeMethod(Protocol):
    """Baking of a light transport method; nothing of pictures."""

    @property
    def name(self) -> str:
        """Name of the method in recipes."""
        ...

    @property
    def stages(self) -> tuple[str, ...]:
        """Names of its stages, in order."""
        ...

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        """Cost of a bake; pure, traces nothing. Raises PlanError if the recipe does not fit the scene."""
        ...

    def prepare(self, scene: Scene) -> None:
        """Build and cache data that all tasks of a scene share in one process."""
        ...

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        """Root attributes of the store: JSON; with the scene's look, enough to open it without the scene."""
        ...

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """The tasks of a stage; pure.

        Args:
            stage: index into `stages`. scene: the scene. recipe: its recipe.
            store: output of the earlier stages.
        """
        ...

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """The arrays that a stage fills and whose shapes are known before it runs; pure.

        Args:
            stage: index into `stages`. scene: the scene. recipe: its recipe.
            store: output of the earlier stages.
        """
        ...

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: TaskStore) -> TaskOutput:
        """Compute a task's rows; pure, seeded by (scene id, task).

        Args:
            scene: the scene. recipe: its recipe.
            task: one of `tasks`.
            store: output of the earlier stages.
        Returns:
            Rows of the arrays that `arrays` lists. The task itself creates others as a whole (the samples of a view,
            whose number is unknown before tracing).
        """
        ...
