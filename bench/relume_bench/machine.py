"""Processor time that the host gave to other guests during a measurement."""

from __future__ import annotations

from pathlib import Path

_STAT = Path("/proc/stat")  # Linux only
_USER, _NICE, _SYSTEM, _IRQ, _SOFT_IRQ, _STEAL = 0, 1, 2, 5, 6, 7


def processor_ticks() -> tuple[int, int] | None:
    """Ticks since boot that programs here requested, and those that the host did not give."""
    if not _STAT.is_file():
        return None
    with _STAT.open() as lines:
        ticks = [int(tick) for tick in lines.readline().split()[1:]]
    stolen = ticks[_STEAL]
    return stolen + sum(ticks[k] for k in (_USER, _NICE, _SYSTEM, _IRQ, _SOFT_IRQ)), stolen


def measure_stolen_fraction(before: tuple[int, int] | None, after: tuple[int, int] | None) -> float | None:
    """Fraction of the requested processor time between two readings that went to other guests; None if unknown.

    At 0.5 a wall time is about twice what the machine needs by itself.
    """
    if before is None or after is None or after[0] <= before[0]:
        return None
    return round((after[1] - before[1]) / (after[0] - before[0]), 3)
