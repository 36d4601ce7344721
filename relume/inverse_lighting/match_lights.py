"""Match lights to a target: solves, and reports."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import luminance
from relume.inverse_lighting.painting import PaintedTarget
from relume.inverse_lighting.report import Shortfall, residual, shortfalls
from relume.inverse_lighting.solve import RIDGE, NormalEquations, solve_strengths
from relume.inverse_lighting.sources import Sources, strength_changes

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Match:
    """A solution.

    Attributes:
        changes: changed fields by the JSON pointers of their sources. stops: change of their luminance; None from or to
            black. image: its radiance. shortfalls: regions that are not reached.
        residual: relative RMS error of the marked pixels; `residual_before`: that of the current look. error: the same
            of all pixels with weight, also those that are to stay.
    """

    changes: dict[str, dict[str, Any]]
    stops: dict[str, float | None]
    image: Shaped[NDArray[np.float32], "height width 3"]
    residual: float
    residual_before: float
    error: float
    shortfalls: tuple[Shortfall, ...]


def match_lights(
    sources: Sources,
    painted: PaintedTarget,
    locked: Collection[str] = (),
    *,
    changes_color: bool = True,
    ridge: float = RIDGE,
    before: Shaped[NDArray[np.float32], "height width 3"] | None = None,
) -> Match:
    """Find the intensities and colors of lights with which the image is nearest to a target.

    Args:
        sources: the sources. painted: the target. locked: pointers of sources that stay.
        changes_color: colors change, too. ridge: see `relume.inverse_lighting.solve`.
        before: current image, if the sources are those of a look with other changes.
    Raises:
        ShapeMismatchError: the target has another size.
    """
    is_free = np.array([pointer not in locked for pointer in sources.pointers])
    equations = NormalEquations.from_target(sources, painted.target)
    keeps_balance = all(region.kind != "reference" for region in painted.regions)
    strengths = solve_strengths(
        sources, equations, is_free, changes_color=changes_color, keeps_balance=keeps_balance, ridge=ridge
    )
    image, radiance, marked = sources.image(strengths), painted.target.radiance, painted.marked
    before = sources.image(sources.strengths) if before is None else before
    changes = strength_changes(sources, strengths, changes_color=changes_color)
    return Match(
        changes,
        {pointer: _stops(sources, strengths, pointer) for pointer in changes},
        image,
        residual(image, radiance, marked),
        residual(before, radiance, marked),
        residual(image, radiance, painted.target.weights),
        tuple(shortfalls(sources, (before, image), is_free, radiance, painted.regions)),
    )


def _stops(sources: Sources, strengths: F64, pointer: str) -> float | None:
    k = sources.pointers.index(pointer)
    before, after = (float(luminance(each[k].astype(np.float32))) for each in (sources.strengths, strengths))
    return math.log2(after / before) if min(before, after) > 0.0 else None
