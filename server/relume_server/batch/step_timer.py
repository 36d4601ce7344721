"""Estimate the time of equal steps, from earlier steps or from a sample."""

from __future__ import annotations

import time
from collections.abc import Callable

_ENOUGH = 0.02  # below this fraction of a step, its progress says little
_EARLY = 0.25  # of a sample: until then much is one-time work, such as loading kernels


class StepTimer:
    """Times the steps of a running job."""

    def __init__(self, step_s: float | None) -> None:
        """
        Args:
            step_s: seconds per step of earlier jobs; None if unknown.
        """
        self._step_s, self._start_s, self.fraction = step_s, time.monotonic(), 0.0

    def start(self) -> None:
        """Start the first step: preparation before it is one-time work."""
        self._start_s = time.monotonic()

    def report(self, fraction: float) -> None:
        """Record progress of the current step, 0…1."""
        self.fraction = fraction

    def next_step(self) -> float:
        """Finish the current step. Returns: seconds per step, recent ones weighted more."""
        elapsed_s, previous_s = time.monotonic() - self._start_s, self._step_s
        self._step_s = elapsed_s if previous_s is None else 0.5 * (previous_s + elapsed_s)
        self._start_s, self.fraction = time.monotonic(), 0.0
        return self._step_s

    def seconds_left(self, steps: int) -> float | None:
        """Seconds for this many steps including the current one; None if nothing has been measured yet."""
        step_s = self._step_s
        if self.fraction > _ENOUGH:
            current_s = (time.monotonic() - self._start_s) / self.fraction
            step_s = current_s if step_s is None else (1 - self.fraction) * step_s + self.fraction * current_s
        return None if step_s is None else max(0.0, steps - self.fraction) * step_s


def estimate_seconds(work: Callable[[Callable[[float], object]], object], scale: float) -> float:
    """Estimate the seconds of work whose main part is `scale` times as large.

    Args:
        work: does a small sample; called with a progress callback. scale: scale of the main part.
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
