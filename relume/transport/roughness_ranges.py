"""Points of several levels of roughness under one term: each range of them is projected with its own curves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.lights.spherical_triangles import TriangleLights
from relume.transport.projector import Projector
from relume.transport.shading.shader import Shader
from relume.transport.shading_points import ShadingPoints
from relume.transport.term_contraction import Contraction, contract

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def at_roughness(bands: Mapping[str, F64], level: int) -> dict[str, F64]:
    """The curves at one level: those that do not differ from level to level are the same. (3, J) each

    Args:
        bands: of each curve, (3, J), or (L, 3, J) where it differs.
    """
    return {name: rows[level] if rows.ndim == 3 else rows for name, rows in bands.items()}


def without_free_curves(bands: Mapping[str, F64], free: Iterable[str]) -> dict[str, F64]:
    """The same curves, the free ones as at the first level: their values do not matter, and they need no levels.

    Args:
        bands: as `at_roughness` takes them. free: names of the curves.
    """
    return {**bands, **at_roughness({name: bands[name] for name in free}, 0)}


def num_levels(bands: Mapping[str, F64]) -> int:
    """L, or 1 where no curve differs."""
    return max((len(rows) for rows in bands.values() if rows.ndim == 3), default=1)


def contract_levels(term: Term, bands: Mapping[str, F64], active: str | None) -> tuple[Contraction, ...]:
    """`relume.transport.term_contraction.contract` at each level.

    Args:
        term: whose curves these are. bands: as `at_roughness` takes them. active: the curve that stays free, if any.
    """
    return tuple(contract(term, at_roughness(bands, level), active) for level in range(num_levels(bands)))


def split_by_level(level: NDArray[np.uint8] | None, num: int, start: int, stop: int) -> Iterator[tuple[int, int, int]]:
    """Cut points [start, stop) into ranges of one level each.

    Args:
        level: of all points. (n,), or None where there is one for all
        num: levels that are told apart; 1: the range stays whole. start, stop: of the points.
    Yields:
        Level, first point, end.
    """
    if num == 1 or level is None or start == stop:
        yield 0, start, stop
        return
    cuts = np.flatnonzero(np.diff(level[start:stop])) + 1 + start
    for first, last in pairwise([start, *cuts.tolist(), stop]):
        yield int(level[first]), first, last


def project_levels(
    term: Term,
    contractions: Sequence[Contraction],
    lights: TriangleLights,
    receivers: ShadingPoints,
    start: int,
    stop: int,
    projector: Callable[[Term, Contraction, TriangleLights, ShadingPoints], Projector | Shader] = Projector,
) -> F32:
    """`Projector.project`, or that of another projector, with the curves of each point's level.

    Args:
        term, lights, receivers: as `Projector` takes them. contractions: from `contract_levels`.
        start, stop: of the points. projector: which one.
    """
    projected = [
        projector(term, contractions[level], lights, receivers).project(first, last)
        for level, first, last in split_by_level(receivers.level, len(contractions), start, stop)
    ]
    return projected[0] if len(projected) == 1 else np.concatenate(projected)
