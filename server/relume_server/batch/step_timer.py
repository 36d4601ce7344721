"""How long work in equal steps takes: known from steps before, else judged by a sample of one."""

from __future__ import annotations

import time
from collections.abc import Callable

_ENOUGH = 0.02  # of a step: before, its share says little
_EARLY = 0.25  # of a sample: until then much is made that is made once, such as kernels


class StepTimer:
    """Times the steps of one work while it runs."""

    def __init__(self, step_s: float | None) -> None:
        """
        Args:
            step_s: seconds that a step has taken before; None where that is not known.
        """
        self._step_s, self._start_s, self.fraction = step_s, time.monotonic(), 0.0

    def start(self) -> None:
        """The first step begins now: what was done before is done once."""
        self._start_s = time.monotonic()

    def report(self, fraction: float) -> None:
        """So much of the step at hand is done, 0…1."""
        self.fraction = fraction

    def next_step(self) -> float:
        """The step at hand is done. Returns: how many seconds a step takes, later ones counting more."""
        elapsed_s, previous_s = time.monotonic() - self._start_s, self._step_s
        self._step_s = elapsed_s if previous_s is None else 0.5 * (previous_s + elapsed_s)
        self._start_s, self.fraction = time.monotonic(), 0.0
        return self._step_s

    def seconds_left(self, steps: int) -> float | None:
        """Until so many steps are done, that at hand included; None where nothing was measured yet."""
        step_s = self._step_s
        if self.fraction > _ENOUGH:
            current_s = (time.monotonic() - self._start_s) / self.fraction
            step_s = current_s if step_s is None else (1 - self.fraction) * step_s + self.fraction * current_s
        return None if step_s is None else max(0.0, steps - self.fraction) * step_s


def estimate_seconds(work: Callable[[Callable[[float], object]], object], scale: float) -> float:
    """Seconds that work would take if all but its preparation were `scale` times as much.

    Args:
        work: does a small sample; called with whom to tell its progress.
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
