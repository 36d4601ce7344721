"""Long work on rows, step by step: whoever is stopped goes on from there, and some of it may go first."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from relume.core.thread_pools import Kernel, parallel_for_cancellable


@dataclass(frozen=True, eq=False)
class ResumableLoop:
    """Which steps of work on n rows are done.

    Attributes:
        num_rows: n. grain: rows of a step.
        done: which steps are. (steps,)
        lock: held while some are worked on.
    """

    num_rows: int
    grain: int
    done: NDArray[np.bool_]
    lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    @classmethod
    def start(cls, num_rows: int, grain: int) -> ResumableLoop:
        """None of them."""
        return cls(num_rows, grain, np.zeros(-(-num_rows // grain), np.bool_))

    def run(
        self,
        kernel: Kernel,
        progress: Callable[[float], object],
        is_canceled: Callable[[], bool],
        label: str,
        selected_rows: NDArray[np.bool_] | None = None,
    ) -> None:
        """Do what is lacking.

        Args:
            kernel: called with the ends of the rows of a step. progress, is_canceled, label: as of
                `parallel_for_cancellable`.
            selected_rows: rows that are worked on, with those of their steps; None: all. (n,)
        Raises:
            CancelledError: `is_canceled` said so; what was done stays.
        """
        with self.lock:
            pending = np.flatnonzero(
                ~self.done if selected_rows is None else self._steps_containing(selected_rows) & ~self.done
            )

            def step(start: int, stop: int) -> None:
                for k in pending[start:stop]:
                    kernel(int(k) * self.grain, min((int(k) + 1) * self.grain, self.num_rows))
                    self.done[k] = True

            parallel_for_cancellable(step, len(pending), 1, progress, is_canceled, label)

    def _steps_containing(self, selected_rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which steps have any of some rows."""
        return np.logical_or.reduceat(selected_rows, np.arange(0, len(selected_rows), self.grain))
