"""Long work on rows, in steps: interrupted work resumes, and selected rows can go first."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.thread_pools import Kernel, parallel_for_cancellable


@dataclass(frozen=True, eq=False)
class ResumableLoop:
    """Progress of work on `num_rows` rows.

    Attributes:
        num_rows: n. grain: rows per step.
        done: true for finished steps.
        lock: held while steps run.
    """

    num_rows: int
    grain: int
    done: Shaped[NDArray[np.bool_], " steps"]
    lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    @classmethod
    def start(cls, num_rows: int, grain: int) -> ResumableLoop:
        """Make a loop with no step done."""
        return cls(num_rows, grain, np.zeros(-(-num_rows // grain), np.bool_))

    def run(
        self,
        kernel: Kernel,
        progress: Callable[[float], object],
        is_canceled: Callable[[], bool],
        label: str,
        selected_rows: Shaped[NDArray[np.bool_], " n"] | None = None,
    ) -> None:
        """Run the steps that are not done.

        Args:
            kernel: called with the first and last row of a step. progress, is_canceled, label: as in
                `parallel_for_cancellable`.
            selected_rows: true for rows to work on, with the rest of their steps; None: all.
        Raises:
            CancelledError: `is_canceled` returned true; finished steps stay done.
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
        """Return true for each step that contains a selected row."""
        return np.logical_or.reduceat(selected_rows, np.arange(0, len(selected_rows), self.grain))
