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
        self._step_s, self._began, self.share = step_s, time.monotonic(), 0.0

    def begin(self) -> None:
        """The first step begins now: what was done before is done once."""
        self._began = time.monotonic()

    def tell(self, share: float) -> None:
        """So much of the step at hand is done, 0…1."""
        self.share = share

    def next_step(self) -> float:
        """The step at hand is done. Returns: how many seconds a step takes, later ones counting more."""
        took, known = time.monotonic() - self._began, self._step_s
        self._step_s = took if known is None else 0.5 * (known + took)
        self._began, self.share = time.monotonic(), 0.0
        return self._step_s

    def seconds_left(self, steps: int) -> float | None:
        """Until so many steps are done, that at hand included; None where nothing was measured yet."""
        step_s = self._step_s
        if self.share > _ENOUGH:
            of_this = (time.monotonic() - self._began) / self.share
            step_s = of_this if step_s is None else (1 - self.share) * step_s + self.share * of_this
        return None if step_s is None else max(0.0, steps - self.share) * step_s


def sampled(work: Callable[[Callable[[float], object]], object], scale: float) -> float:
    """Seconds that work would take if all but its preparation were `scale` times as much.

    Args:
        work: does a small sample; called with whom to tell its progress.
    """
    began = time.monotonic()
    early: list[tuple[float, float]] = []

    def tell(share: float) -> None:
        if not early and share >= _EARLY:
            early.append((time.monotonic(), share))

    work(tell)
    ended = time.monotonic()
    at, share = early[0] if early else (began, 0.0)
    whole = (ended - at) / (1 - share) if share < 1 else ended - began
    return max(0.0, at - began - share * whole) + scale * whole
