"""What a bake is: plan (pure), tasks, compute (pure), and what a worker needs to run it.

bake (worker, once) → freeze (server, on touch) → frame (server, per edit). A method joins by one module and one line in
`relume.methods.registry`, and inherits the contract suite in tests/contract.
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
    """Rows that need not be in memory together: an array, or what reads them when they are asked for."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Of all rows."""
        ...

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of a number."""
        ...

    def __getitem__(self, rows: slice, /) -> NDArray[Any]:
        """Some rows that follow each other."""
        ...


Arrays = Mapping[str, RowSource]


@dataclass(frozen=True)
class Recipe:
    """What to bake. The same scene and recipe give the same store under the same code, bit for bit.

    Attributes:
        method: name of a transfer method.
        views: camera names, in order.
        size: width and height in pixels.
        num_lights: triangles that the environment is divided into.
        relightable: choose them for an environment that will be turned or exchanged, not for the one that is there.
        cameras: those of `views` that somebody placed; the others came with the scene.
        num_probes: surface probes of a free camera; methods of fixed views have none.
        num_patches: surface patches for indirect light. gather_rays: of each view sample, or probe. None: as many as
            the method finds fit; `direct` has none.
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
        """The scene with the cameras that this recipe brings: what its method plans and bakes."""
        return with_cameras(scene, [placed_camera.camera for placed_camera in self.cameras]) if self.cameras else scene


@dataclass(frozen=True)
class ArraySpec:
    """One Zarr array of a store.

    Attributes:
        path: inside the store, e.g. "views/front/visibility".
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
        stage: index into `BakeMethod.stages`; a stage starts when the one before is complete.
        index: position within the stage; (stage, index) names the task.
        group: the view it belongs to, "" for none.
        start, stop: the rows of the stage's arrays that it owns, shard-aligned.
    """

    stage: int
    index: int
    group: str
    start: int
    stop: int


@dataclass(frozen=True)
class Plan:
    """What a bake will cost, before anything is traced. Upper bounds.

    Attributes:
        num_rays: shadow and camera rays.
        store_bytes: on disk, uncompressed.
        disk_bytes: on disk, as a little of it takes; no bound. 0 where none was tried: then `store_bytes` counts.
        scratch_bytes: of files that are there besides while it is baked.
        peak_bytes: memory of one worker process.
        lone_bytes: what of it one process takes while the others do without: of a step that is one task.
        work_s: about what one core takes that was measured once: plans are compared by it. 0 in plans of before.
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
        """Of the finished store, on disk."""
        return self.disk_bytes or self.store_bytes


@dataclass(frozen=True)
class TaskOutput:
    """What a task computed: rows [start, stop) of each array, and what it cost.

    Attributes:
        arrays: by array path, the task's rows.
        num_rays: rays traced. trace_s: seconds spent in the tracing kernels alone.
    """

    arrays: Arrays
    num_rays: int
    trace_s: float


class StoreReader(Protocol):
    """Reads what earlier stages wrote; raises `ChunkDamagedError` where a checksum fails."""

    def read(self, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Rows [start, stop) of the array at a path inside the store; `stop` None for all that follow."""
        ...

    def shape(self, path: str) -> tuple[int, ...]:
        """Shape of an array."""
        ...

    @property
    def attributes(self) -> Mapping[str, Any]:
        """The store's root attributes."""
        ...


class TaskStore(StoreReader, Protocol):
    """What a task reads, and where it puts aside what it would not hold in memory."""

    def scratch(self) -> IO[bytes]:
        """A file, open for writing and reading, that is gone when it is closed."""
        ...


class BakeMethod(Protocol):
    """How one paper's light transport is baked; `relume.methods.base.TransferMethod` opens it as well."""

    @property
    def name(self) -> str:
        """What recipes call it."""
        ...

    @property
    def stages(self) -> tuple[str, ...]:
        """Names of its stages, in order."""
        ...

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        """Cost of a bake; pure, traces nothing. Raises PlanError where the recipe does not fit the scene."""
        ...

    def prepare(self, scene: Scene) -> None:
        """Build what all tasks of a scene share in one process; kept for the next."""
        ...

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        """Root attributes of the store: JSON, enough to open it without the scene."""
        ...

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """The tasks of a stage; pure.

        Args:
            stage: index into `stages`. scene: that is baked. recipe: how.
            store: what the stages before wrote.
        """
        ...

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """The arrays that a stage fills and whose shape is known before it runs; pure.

        Args:
            stage: index into `stages`. scene: that is baked. recipe: how.
            store: what the stages before wrote.
        """
        ...

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: TaskStore) -> TaskOutput:
        """Compute a task's rows; pure, seeded by (scene id, task).

        Args:
            scene: that is baked. recipe: how.
            task: one of `tasks`.
            store: what the stages before wrote.
        Returns:
            Rows of the arrays that `arrays` announces. Others are created by the task itself, whole (the view samples
            of a view, whose number only tracing tells).
        """
        ...
