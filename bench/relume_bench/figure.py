"""Result of a benchmark: name, value, unit, and context."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Figure:
    """One line of `relume bench`.

    Attributes:
        value: None if it could not be measured; the context has the reason in "skipped".
        context: sizes, both sides of a ratio, the parts of a maximum.
        standard_error: standard error of a Monte Carlo estimate, in the same unit; None for all others.
    """

    name: str
    value: float | None
    unit: str
    context: dict[str, Any] = field(default_factory=dict)
    standard_error: float | None = None


def skipped(names: tuple[str, ...], unit: str, why: str) -> list[Figure]:
    """Figures that this machine cannot measure.

    Args:
        names: names of the figures. unit: unit of the figures.
        why: sentence for the context.
    """
    return [Figure(name, None, unit, {"skipped": why}) for name in names]
