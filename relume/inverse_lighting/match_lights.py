"""Match lights to a target: solves, and reports."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from relume.core.errors import ParameterError
from relume.core.validation import names_text
from relume.inverse_lighting.painting import PaintedTarget
from relume.inverse_lighting.report import Shortfall, residual, shortfalls
from relume.inverse_lighting.solve import RIDGE, NormalEquations, solve_strengths
from relume.inverse_lighting.sources import Sources, strength_changes


@dataclass(frozen=True)
class Match:
    """A solution.

    Attributes:
        changes: changed fields by the JSON pointers of their sources. residual: relative RMS error of the marked
            pixels; `residual_before`: that of the current look. shortfalls: parts that are not reached.
    """

    changes: dict[str, dict[str, Any]]
    residual: float
    residual_before: float
    shortfalls: tuple[Shortfall, ...]


def match_lights(
    sources: Sources,
    painted: PaintedTarget,
    locked: Collection[str] = (),
    *,
    changes_color: bool = True,
    ridge: float = RIDGE,
) -> Match:
    """Find the intensities and colors of lights with which the image is nearest to a target.

    Args:
        sources: the sources. painted: the target. locked: JSON pointers of sources that stay.
        changes_color: colors change, too. ridge: see `relume.inverse_lighting.solve`.
    Raises:
        ParameterError: a pointer in `locked` is no source. ShapeMismatchError: the target has another size.
    """
    if unknown := set(locked) - set(sources.pointers):
        raise ParameterError("locked", min(unknown), f"pointers of enabled lights: {names_text(sources.pointers)}")
    is_free = np.array([pointer not in locked for pointer in sources.pointers])
    equations = NormalEquations.from_target(sources, painted.target)
    strengths = solve_strengths(sources, equations, is_free, changes_color=changes_color, ridge=ridge)
    radiance, marked = painted.target.radiance, painted.marked
    return Match(
        strength_changes(sources, strengths, changes_color=changes_color),
        residual(sources.image(strengths), radiance, marked),
        residual(sources.image(sources.strengths), radiance, marked),
        tuple(shortfalls(sources, strengths, is_free, radiance, painted.parts)),
    )
