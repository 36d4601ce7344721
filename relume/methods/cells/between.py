"""Light between surfaces: what cells send, reflection after reflection, until it is even.

    t^0: from the lights;   L^b = F t^b;   t^(b+1)(c) = mean over the rays r of c of π L^b(link(c, r), −ω_r) h(ω_r)

The first reflections keep the directions that highlights give light. What is reflected once more has come from
everywhere: from then on a cell sends the same to all others, the mean of what they see of it
(`relume.methods.cells.bounces`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.methods.cells.bounces import bounce, bounced, preview_bounced
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.reflecting import Arrived, Reflecting
from relume.project.sent import Sent, sent_by
from relume.trace.cell_tree import NO_CELL

F32 = NDArray[np.float32]

_DIRECTED = 2  # reflections


def sent_between(cells: CellLight, reflecting: Reflecting, arrived: Arrived, first: int, last: int) -> Sent:
    """What every cell sends out of light that surfaces have reflected `first` to `last` times, its own included.

    Args:
        cells: that send it. reflecting: what they make of light.
        arrived: from the lights. first: at least 1. last: not less.
    """
    rows, frame = reflecting.rows, cells.frames[reflecting.rows]
    even, vectors = reflecting.sent(arrived)
    number, directed = 1, min(last, _DIRECTED) if len(rows) else 1
    total, total_vectors = (float(first == 1) * array.astype(np.float64) for array in (even, vectors))
    while number < directed:
        now = sent_by(_padded(even), rows, frame, vectors)
        (even, vectors), number = reflecting.sent(cells.arriving(now, rows)), number + 1
        if number >= first:
            total, total_vectors = total + even, total_vectors + vectors
    if number < last:
        even, links, rho = cells.seen(even, vectors, rows), cells.links, reflecting.reflectance
        start = max(first, number + 1)
        for _ in range(start - number):
            even = bounce(links, rho, even)
        total += bounced(links, rho, even, last - start)
    return sent_by(_padded(total), rows, frame, total_vectors.astype(np.float32))


def preview_between(cells: CellLight, reflecting: Reflecting, arrived: Arrived, first: int, last: int) -> F32:
    """The same roughly, in a fifth of the time, as others see it in the mean. (NO_CELL + 1, 3) float32

    Args:
        cells, reflecting, arrived, first, last: as of `sent_between`.
    """
    even = cells.seen(*reflecting.sent(arrived), reflecting.rows)
    for _ in range(first - 1):
        even = bounce(cells.links, reflecting.reflectance, even)
    return _padded(preview_bounced(cells.links, cells.few_links, reflecting.reflectance, even, last - first))


def _padded(even: NDArray[np.floating[Any]]) -> F32:
    """Radiance of cells, (C, 3), and black for those that are none. (NO_CELL + 1, 3) float32"""
    out = np.zeros((NO_CELL + 1, 3), np.float32)
    out[: len(even)] = even
    return out
