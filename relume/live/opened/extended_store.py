"""Stores that are extended in memory, and the tasks that write them."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import CancelledError, StoreError
from relume.core.thread_pools import map_ordered
from relume.live.fixed_camera.jobs import CancelCheck
from relume.store.bake_protocol import ArraySpec, StoreReader, Task, TaskOutput

_MAX_RESULTS = 4  # of tasks that wait to be written


class ExtendedStore:
    """A read-only store with further or other arrays in memory; a `TaskStore`. Its views are in memory alone.

    Attributes:
        arrays: in memory. is_canceled: polled by long tasks.
    """

    def __init__(self, store: StoreReader, attributes: Mapping[str, Any]) -> None:
        self._store, self._attributes = store, {**store.attributes, **attributes}
        self.arrays: dict[str, NDArray[Any]] = {}
        self.is_canceled: CancelCheck = lambda: False

    @property
    def attributes(self) -> Mapping[str, Any]:
        """Attributes of the store, overridden by the given ones."""
        return self._attributes

    def shape(self, path: str) -> tuple[int, ...]:
        """Shape of an array."""
        return self.arrays[path].shape if path in self.arrays else self._below(path).shape(path)

    def check_canceled(self) -> None:
        """Raise CancelledError if `is_canceled` returns true."""
        if self.is_canceled():
            raise CancelledError("the view was canceled")

    def scratch(self) -> IO[bytes]:
        """Return a scratch file in memory, where the whole view is held."""
        return io.BytesIO()

    def read(self, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Rows [start, stop) of the array at a path."""
        array = self.arrays.get(path)
        return self._below(path).read(path, start, stop) if array is None else array[start:stop]

    def allocate(self, specs: Iterable[ArraySpec]) -> None:
        """Add arrays whose rows tasks will write."""
        self.arrays.update({spec.path: np.empty(spec.shape, spec.dtype) for spec in specs})

    def write(self, task: Task, output: TaskOutput) -> None:
        """Write the rows that a task has computed."""
        for path, rows in output.arrays.items():
            if path in self.arrays:
                self.arrays[path][task.start : task.stop] = rows

    def _below(self, path: str) -> StoreReader:
        """Return the extended store. Raises StoreError for arrays of its views, which are other ones."""
        if path.startswith("views/"):
            raise StoreError(f"the view has no array {path}")
        return self._store


def split_tasks(tasks: Iterable[Task], num_rows: int) -> Iterator[Task]:
    """Split tasks into such of at most `num_rows` rows, so that each is short enough for a cancellation to wait for."""
    for task in tasks:
        for start in range(task.start, task.stop, num_rows):
            yield replace(task, start=start, stop=min(start + num_rows, task.stop))


def write_tasks(
    store: ExtendedStore,
    tasks: Sequence[Task],
    compute: Callable[[Task], TaskOutput],
    report: Callable[[], None],
    is_canceled: CancelCheck,
) -> None:
    """Compute tasks side by side, each on its thread, and write their results in order.

    Args:
        store: that is written. tasks: disjoint rows. compute: a task; thread-safe.
        report: called after each task is written. is_canceled: polled before each is computed, and written.
    Raises:
        CancelledError: `is_canceled` returned true.
    """

    def check() -> None:
        if is_canceled():
            raise CancelledError("the tracing was canceled")

    def work(task: Task) -> TaskOutput:
        check()
        return compute(task)

    with closing(map_ordered(work, tasks, _MAX_RESULTS)) as outputs:
        for task, output in zip(tasks, outputs, strict=True):
            check()
            store.write(task, output)
            report()
