"""Check that the server's resources stay constant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume_bench.soak.server import Sample

WARMUP_FRACTION = 0.4
MIN_SAMPLES = 12


@dataclass(frozen=True)
class Trend:
    """Trend of one number over a soak test, without its warm-up.

    Attributes:
        early, late: medians of the first and the last third. slope_per_hour: slope per hour of the regression line.
        error_per_hour: its standard error. allowed: growth that is accepted.
    """

    name: str
    early: float
    late: float
    slope_per_hour: float
    error_per_hour: float
    allowed: float

    @property
    def is_flat(self) -> bool:
        """True if there is no growth beyond the accepted one."""
        return self.late - self.early <= self.allowed

    def line(self) -> str:
        """Describe the trend."""
        verdict = "flat" if self.is_flat else "GROWS"
        slope = f"{self.slope_per_hour:+,.1f} ± {self.error_per_hour:,.1f} an hour"
        return f"{self.name:14} {self.early:12,.1f} → {self.late:12,.1f}   {slope:32} {verdict}"


def trends(samples: Sequence[Sample]) -> list[Trend]:
    """Trends of memory, handles, threads and disk; bytes in MB.

    Raises:
        ValueError: there are too few samples.
    """
    warm = [sample for sample in samples if sample.at_s >= WARMUP_FRACTION * samples[-1].at_s]
    if len(warm) < MIN_SAMPLES:
        raise ValueError(f"{len(warm)} samples after the warm-up are too few; run longer")
    memory_mb = np.array([sample.memory_bytes for sample in warm]) / 1e6
    return [
        _trend("memory MB", warm, memory_mb, 0.05 * float(np.median(memory_mb)) + 20),
        _trend("handles", warm, np.array([sample.handles for sample in warm]), 12),
        _trend("threads", warm, np.array([sample.threads for sample in warm]), 8),
        _trend("disk MB", warm, np.array([sample.disk for sample in warm]) / 1e6, 30),
    ]


def _trend(name: str, samples: Sequence[Sample], values: np.ndarray, allowed: float) -> Trend:
    hours = np.array([sample.at_s for sample in samples]) / 3600
    third = max(1, len(values) // 3)
    (slope, _), covariance = np.polyfit(hours, values, 1, cov=True)
    early, late = float(np.median(values[:third])), float(np.median(values[-third:]))
    return Trend(name, early, late, float(slope), float(np.sqrt(covariance[0, 0])), allowed)
