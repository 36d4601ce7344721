"""What the machine did beside a measurement: processor time that its host gave to other guests."""

from __future__ import annotations

from pathlib import Path

_STAT = Path("/proc/stat")  # Linux; elsewhere nothing is said
_USER, _NICE, _SYSTEM, _IRQ, _SOFT_IRQ, _STEAL = 0, 1, 2, 5, 6, 7


def processor_ticks() -> tuple[int, int] | None:
    """Ticks since the start that were wanted by programs here, and those of them that the host did not give."""
    if not _STAT.is_file():
        return None
    with _STAT.open() as lines:
        ticks = [int(tick) for tick in lines.readline().split()[1:]]
    stolen = ticks[_STEAL]
    return stolen + sum(ticks[k] for k in (_USER, _NICE, _SYSTEM, _IRQ, _SOFT_IRQ)), stolen


def measure_stolen_fraction(before: tuple[int, int] | None, after: tuple[int, int] | None) -> float | None:
    """Share of the wanted processor time between two readings that went to other guests; None where it is not known.

    A wall time measured while it is 0.5 is about twice what the machine needs by itself.
    """
    if before is None or after is None or after[0] <= before[0]:
        return None
    return round((after[1] - before[1]) / (after[0] - before[0]), 3)
