"""What a benchmark says: a name, a value, its unit, and how it came about."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Figure:
    """One line of `relume bench`.

    Attributes:
        value: None where it could not be measured; then the context says why in "skipped".
        context: sizes, both sides of a ratio, the parts of a maximum.
        standard_error: of a value that is a Monte Carlo estimate, in the same unit; None of all others.
    """

    name: str
    value: float | None
    unit: str
    context: dict[str, Any] = field(default_factory=dict)
    standard_error: float | None = None


def skipped(names: tuple[str, ...], unit: str, why: str) -> list[Figure]:
    """Figures that this machine cannot give.

    Args:
        names: of the figures. unit: that they would have.
        why: a sentence for their rows.
    """
    return [Figure(name, None, unit, {"skipped": why}) for name in names]
