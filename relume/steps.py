"""Long work on rows, step by step: whoever is stopped goes on from there, and some of it may go first."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from relume.parallel import Kernel, for_steps


@dataclass(frozen=True, eq=False)
class Steps:
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
    def of(cls, num_rows: int, grain: int) -> Steps:
        """None of them."""
        return cls(num_rows, grain, np.zeros(-(-num_rows // grain), np.bool_))

    def work(
        self,
        kernel: Kernel,
        progress: Callable[[float], object],
        cancelled: Callable[[], bool],
        what: str,
        wanted: NDArray[np.bool_] | None = None,
    ) -> None:
        """Do what is lacking.

        Args:
            kernel: called with the ends of the rows of a step. progress, cancelled, what: as of `for_steps`.
            wanted: rows that are worked on, with those of their steps; None: all. (n,)
        Raises:
            CancelledError: `cancelled` said so; what was done stays.
        """
        with self.lock:
            lacking = np.flatnonzero(~self.done if wanted is None else self._having(wanted) & ~self.done)

            def step(start: int, stop: int) -> None:
                for k in lacking[start:stop]:
                    kernel(int(k) * self.grain, min((int(k) + 1) * self.grain, self.num_rows))
                    self.done[k] = True

            for_steps(step, len(lacking), 1, progress, cancelled, what)

    def _having(self, wanted: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which steps have any of some rows."""
        return np.logical_or.reduceat(wanted, np.arange(0, len(wanted), self.grain))
