"""Estimate the time of equal steps, several of which may run at once."""

from __future__ import annotations

import time
from collections.abc import Callable

_ENOUGH = 0.02  # of a step; below it, progress says little
_EARLY = 0.25  # of a sample: until then much is one-time work, such as loading kernels


class StepTimer:
    """Times the steps of a running job. Thread-safe."""

    def __init__(self, step_s: float | None) -> None:
        """
        Args:
            step_s: seconds per step of earlier jobs; None if unknown.
        """
        self._prior_s, self._start_s, self._num_done = step_s, time.monotonic(), 0
        self._fractions = dict[int, float]()

    def start(self) -> None:
        """Start the clock before the first step: preparation is one-time work."""
        if self._num_done == 0:
            self._start_s = time.monotonic()

    def report(self, index: int, fraction: float) -> None:
        """Record the progress of a running step, 0…1."""
        self._fractions[index] = fraction

    def finish(self, index: int) -> None:
        """Count a finished step."""
        self._fractions.pop(index, None)
        self._num_done += 1

    @property
    def fraction(self) -> float:
        """Progress of all running steps together, in steps."""
        return sum(list(self._fractions.values()))

    @property
    def step_s(self) -> float | None:
        """Seconds per step: those measured count as much as a step is done. None if nothing is known."""
        done = self._num_done + self.fraction
        if done <= _ENOUGH:
            return self._prior_s
        measured_s = (time.monotonic() - self._start_s) / done
        trust = min(1.0, done)
        return measured_s if self._prior_s is None else (1 - trust) * self._prior_s + trust * measured_s

    def seconds_left(self, steps: int) -> float | None:
        """Seconds for this many steps, including those that run. None if nothing is known."""
        return None if (step_s := self.step_s) is None else max(0.0, steps - self.fraction) * step_s


def estimate_seconds(work: Callable[[Callable[[float], object]], object], scale: float) -> float:
    """Estimate the seconds of work whose main part is `scale` times as large.

    Args:
        work: does a small sample; called with a progress callback. scale: of the main part.
    """
    began = time.monotonic()
    early: list[tuple[float, float]] = []

    def report(fraction: float) -> None:
        if not early and fraction >= _EARLY:
            early.append((time.monotonic(), fraction))

    work(report)
    ended = time.monotonic()
    early_s, early_fraction = early[0] if early else (began, 0.0)
    whole_s = (ended - early_s) / (1 - early_fraction) if early_fraction < 1 else ended - began
    return max(0.0, early_s - began - early_fraction * whole_s) + scale * whole_s
