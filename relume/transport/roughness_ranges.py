"""Points with several roughness levels under one term: each range of points is projected with its own curves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Shaped
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
    """Return the curves at one level, (3, J) each; curves without levels are unchanged.

    Args:
        bands: bands of each curve, (3, J), or (L, 3, J) if it depends on the level.
    """
    return {name: rows[level] if rows.ndim == 3 else rows for name, rows in bands.items()}


def without_free_curves(bands: Mapping[str, F64], free: Iterable[str]) -> dict[str, F64]:
    """Replace the free curves by their first level: their values do not matter, so they need no levels.

    Args:
        bands: as in `at_roughness`. free: names of the curves.
    """
    return {**bands, **at_roughness({name: bands[name] for name in free}, 0)}


def num_levels(bands: Mapping[str, F64]) -> int:
    """Return the number of levels L; 1 if no curve depends on the level."""
    return max((len(rows) for rows in bands.values() if rows.ndim == 3), default=1)


def contract_levels(term: Term, bands: Mapping[str, F64], active: str | None) -> tuple[Contraction, ...]:
    """Contract a term at each level; see `relume.transport.term_contraction.contract`.

    Args:
        term: with these curves. bands: as in `at_roughness`. active: the free curve, if any.
    """
    return tuple(contract(term, at_roughness(bands, level), active) for level in range(num_levels(bands)))


def split_by_level(
    level: Shaped[NDArray[np.uint8], " n"] | None, num: int, start: int, stop: int
) -> Iterator[tuple[int, int, int]]:
    """Split points [start, stop) into ranges of one level each.

    Args:
        level: roughness levels of all points, or None if all have the same.
        num: number of levels; 1: the range is not split. start, stop: range of points.
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
) -> Shaped[F32, "m columns 3"]:
    """Project points with the curves of each point's level; see `Projector.project`.

    Args:
        term, lights, receivers: as in `Projector`. contractions: from `contract_levels`.
        start, stop: range of points. projector: its class.
    """
    projected = [
        projector(term, contractions[level], lights, receivers).project(first, last)
        for level, first, last in split_by_level(receivers.level, len(contractions), start, stop)
    ]
    return projected[0] if len(projected) == 1 else np.concatenate(projected)
