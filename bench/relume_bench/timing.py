"""Time calls, alternating between them, so that other load disturbs both sides of a ratio."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np


def seconds(call: Callable[[], object]) -> float:
    """Wall time of one call."""
    start_time = time.perf_counter()
    call()
    return time.perf_counter() - start_time


def time_interleaved(calls: Sequence[Callable[[], object]], rounds: int) -> list[list[float]]:
    """Seconds of each call in each round; the first round, which compiles and warms caches, is excluded."""
    for call in calls:
        call()
    durations: list[list[float]] = [[] for _ in calls]
    for _ in range(rounds):
        for call, times in zip(calls, durations, strict=True):
            times.append(seconds(call))
    return durations


def percentiles(values: Sequence[float]) -> tuple[float, float]:
    """p50 and p95."""
    p50, p95 = np.percentile(values, [50, 95])
    return float(p50), float(p95)
